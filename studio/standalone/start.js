// Unpacks what the page holds, and starts it.  Modules get addresses of their own, which an import map
// names before the first of them is loaded.

(async () => {
  const tell = (/** @type {string} */ sentence) => {
    const place = document.getElementById("message");
    if (!place) return;
    const line = document.createElement("p");
    line.className = "message error";
    line.textContent = sentence;
    place.replaceChildren(line);
  };

  const unpacked = (/** @type {string} */ id) => {
    const text = atob(document.getElementById(id)?.textContent ?? "");
    // A hundred times as fast as `Uint8Array.from`, which takes seconds for a page of many megabytes.
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  };

  const addressOf = (/** @type {string} */ source) =>
    URL.createObjectURL(new Blob([source], { type: "text/javascript" }));

  try {
    const programs = JSON.parse(new TextDecoder().decode(await unpacked("programs")));
    const imports = Object.fromEntries(
      Object.entries(programs.modules).map(([name, source]) => [name, addressOf(String(source))]),
    );
    const map = document.createElement("script");
    map.type = "importmap";
    map.textContent = JSON.stringify({ imports });
    document.head.append(map);
    const main = await import(programs.entry);
    // A worklet of a page without an origin, as files are, takes nothing from a blob.
    const processor = `data:text/javascript,${encodeURIComponent(programs.processor)}`;
    await main.start(await unpacked("content"), processor, tell);
  } catch (error) {
    const { message } = /** @type {Error} */ (error);
    tell(`The page could not start (${message}); open it in a current browser.`);
  }
})();
