// Samples as a WAV file.

const FLOAT = 3;
const HEADER_BYTES = 58;

/**
 * A WAV file of 32-bit floating point samples, which nothing rounds or clips.
 *
 * @param {ArrayLike<number>[]} channels Samples of each channel, all as long; full scale is 1.
 * @param {number} rate Samples per second.
 * @returns {ArrayBuffer}
 */
export function wavBytes(channels, rate) {
  const frames = channels[0].length;
  const frameBytes = 4 * channels.length;
  const dataBytes = frames * frameBytes;
  const view = new DataView(new ArrayBuffer(HEADER_BYTES + dataBytes));
  let at = 0;
  /** @param {string} four */
  const name = (four) => {
    for (const letter of four) view.setUint8(at++, letter.charCodeAt(0));
  };
  /** @param {number} value */
  const short = (value) => {
    view.setUint16(at, value, true);
    at += 2;
  };
  /** @param {number} value */
  const long = (value) => {
    view.setUint32(at, value, true);
    at += 4;
  };
  name("RIFF");
  long(HEADER_BYTES - 8 + dataBytes);
  name("WAVE");
  name("fmt ");
  long(18);
  short(FLOAT);
  short(channels.length);
  long(rate);
  long(rate * frameBytes);
  short(frameBytes);
  short(32);
  short(0);
  // Formats other than whole numbers also tell how many samples there are.
  name("fact");
  long(4);
  long(frames);
  name("data");
  long(dataBytes);
  for (let i = 0; i < frames; i++) {
    for (const channel of channels) {
      view.setFloat32(at, channel[i], true);
      at += 4;
    }
  }
  return view.buffer;
}

/**
 * The same as a file to be sent or saved.
 *
 * @param {ArrayLike<number>[]} channels
 * @param {number} rate
 * @returns {Blob}
 */
export function wavBlob(channels, rate) {
  return new Blob([wavBytes(channels, rate)], { type: "audio/wav" });
}
