// Hands on what a microphone hears, sample by sample.

class RecorderProcessor extends AudioWorkletProcessor {
  /**
   * @param {Float32Array[][]} inputs
   * @returns {boolean}
   */
  process(inputs) {
    const channels = inputs[0];
    // The arrays are the browser's own, and filled anew with the next block.
    if (channels.length > 0) this.port.postMessage(channels.map((samples) => samples.slice()));
    return true;
  }
}

registerProcessor("carillon-recorder", RecorderProcessor);
