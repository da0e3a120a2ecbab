// Draws the solids of a notebook.  Each output holds this program, which starts what has not been
// started.  Only what is on the screen is drawn, and only when it changes.
// @ts-check

(() => {
  /** @typedef {{vertices: number, triangles: number, values: boolean, motions: string[]}} Told */

  const [WIDTH, HEIGHT, DISTANCE, ZOOM, AMPLITUDE] = [320, 240, 4, 0.92, 0.16];
  const SHARED = "carillonSolids";

  const VERTEX = `#version 300 es
    in vec3 place, motion;
    in float value;
    uniform mat3 turn;
    uniform float swing, zoom, still;
    out vec3 seen;
    out float shade;
    void main() {
      seen = turn * (2.0 * place - 1.0 + swing * ${AMPLITUDE} * motion);
      shade = still > 0.5 ? value : length(motion);
      // Perspective: the eye is at z = ${DISTANCE}, what is drawn lies 2 to 6 before it.
      float near = ${DISTANCE}.0 - seen.z;
      vec2 plane = ${DISTANCE}.0 * zoom * vec2(${HEIGHT / WIDTH}, 1) * seen.xy;
      gl_Position = vec4(plane, 2.0 * near - 6.0, near);
    }`;
  const FRAGMENT = `#version 300 es
    precision highp float;
    in vec3 seen;
    in float shade;
    uniform float coloured;
    out vec4 colour;
    const vec3 stops[6] = vec3[6](vec3(68, 1, 84), vec3(65, 68, 135), vec3(42, 120, 142),
      vec3(34, 168, 132), vec3(122, 209, 81), vec3(253, 231, 37));
    void main() {
      vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
      if (normal.z < 0.0) normal = -normal;
      float light = 0.42 + 0.55 * max(dot(normal, vec3(-0.45, 0.62, 0.64)), 0.0)
        + 0.15 * max(dot(normal, vec3(0.75, 0.2, 0.63)), 0.0);
      float place = 5.0 * clamp(shade, 0.0, 1.0);
      int below = min(int(place), 4);
      vec3 plain = coloured > 0.5 ? mix(stops[below], stops[below + 1], place - float(below))
        : vec3(230, 204, 163);
      colour = vec4(min(light * plain / 255.0, 1.0), 1);
    }`;

  /** The renderer that all solids of the page draw with; null where there is no WebGL. */
  const makeRenderer = () => {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    const program = gl?.createProgram();
    if (!gl || !program) return null;
    for (const [kind, source] of /** @type {[number, string][]} */ ([
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ])) {
      const shader = gl.createShader(kind);
      if (!shader) return null;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    ["place", "value", "motion"].forEach((name, n) => gl.bindAttribLocation(program, n, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    const at = (/** @type {string} */ name) => gl.getUniformLocation(program, name);
    return { canvas, gl, at };
  };

  const renderer = () => {
    const page = /** @type {Record<string, any>} */ (/** @type {unknown} */ (window));
    if (page[SHARED]?.gl.isContextLost()) delete page[SHARED];
    if (!(SHARED in page)) page[SHARED] = makeRenderer();
    return /** @type {ReturnType<typeof makeRenderer>} */ (page[SHARED]);
  };

  const unpacked = async (/** @type {string} */ text) => {
    const letters = atob(text);
    const bytes = new Uint8Array(letters.length);
    for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  };

  const start = async (/** @type {HTMLElement} */ host) => {
    const shared = renderer();
    const image = host.querySelector("img");
    if (!shared || !image) return;
    const told = /** @type {Told} */ (JSON.parse(host.dataset.view ?? ""));
    const content = await unpacked(host.dataset.content ?? "");
    const { vertices, triangles, values, motions } = told;
    let end = 0;
    /** @param {number} size @returns {ArrayBuffer} the next bytes */
    const next = (size) => content.slice(end, (end += size));
    const parts = {
      places: next(6 * vertices),
      values: values ? next(2 * vertices) : null,
      faces: next(6 * triangles),
      motions: motions.map(() => next(3 * vertices)),
    };

    const canvas = document.createElement("canvas");
    const pen = canvas.getContext("2d");
    if (!pen) return;
    const density = Math.min(2, devicePixelRatio || 1);
    canvas.width = WIDTH * density;
    canvas.height = HEIGHT * density;
    canvas.style.cssText = `width:${WIDTH}px;max-width:100%;touch-action:pan-y;cursor:grab`;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${image.alt}. Drag it, or use the arrow keys, to turn it.`);
    const calm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    const state = { azimuth: -58, elevation: 22, motion: 0, moves: !calm && motions.length > 0 };
    let [isSeen, isDue, phase, before] = [true, false, Math.PI / 2, 0];

    const draw = () => {
      const { gl, at, canvas: sheet } = shared;
      const [e, a] = [state.elevation, state.azimuth].map((angle) => (angle * Math.PI) / 180);
      const [se, ce, sa, ca] = [Math.sin(e), Math.cos(e), Math.sin(a), Math.cos(a)];
      if (sheet.width !== canvas.width || sheet.height !== canvas.height) {
        [sheet.width, sheet.height] = [canvas.width, canvas.height];
      }
      gl.viewport(0, 0, sheet.width, sheet.height);
      gl.clearColor(0, 0, 0, 0);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      // Uploaded anew each time: a few hundred kilobytes, and nothing to free when outputs go.
      /** @type {(WebGLBuffer | null)[]} */
      const made = [];
      const fill = (/** @type {number} */ kind, /** @type {ArrayBuffer} */ data) => {
        const buffer = gl.createBuffer();
        gl.bindBuffer(kind, buffer);
        gl.bufferData(kind, data, gl.STREAM_DRAW);
        made.push(buffer);
      };
      /** @param {number} n @param {ArrayBuffer | null} data @param {number} size @param {number} type */
      const attribute = (n, data, size, type) => {
        if (!data) return gl.disableVertexAttribArray(n);
        fill(gl.ARRAY_BUFFER, data);
        gl.enableVertexAttribArray(n);
        gl.vertexAttribPointer(n, size, type, true, 0, 0);
      };
      attribute(0, parts.places, 3, gl.UNSIGNED_SHORT);
      attribute(1, parts.values, 1, gl.UNSIGNED_SHORT);
      attribute(2, parts.motions[state.motion] ?? null, 3, gl.BYTE);
      fill(gl.ELEMENT_ARRAY_BUFFER, parts.faces);
      const turn = [-sa, -se * ca, ce * ca, ca, -se * sa, ce * sa, 0, ce, se];
      gl.uniformMatrix3fv(at("turn"), false, turn);
      gl.uniform1f(at("swing"), motions.length ? Math.sin(phase) : 0);
      gl.uniform1f(at("zoom"), ZOOM);
      gl.uniform1f(at("still"), motions.length ? 0 : 1);
      gl.uniform1f(at("coloured"), motions.length || values ? 1 : 0);
      gl.drawElements(gl.TRIANGLES, 3 * triangles, gl.UNSIGNED_SHORT, 0);
      made.forEach((buffer) => gl.deleteBuffer(buffer));
      pen.clearRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(sheet, 0, 0);
    };

    const ask = () => {
      if (isDue || !isSeen) return;
      isDue = true;
      requestAnimationFrame((now) => {
        isDue = false;
        if (!canvas.isConnected) return;
        if (state.moves) phase += (Math.min(100, now - before) / 1000) * 2 * Math.PI * 0.7;
        before = now;
        draw();
        if (state.moves) ask();
      });
    };
    const turn = (/** @type {number} */ across, /** @type {number} */ up) => {
      state.azimuth -= across;
      state.elevation = Math.max(-90, Math.min(90, state.elevation + up));
      ask();
    };

    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (canvas.hasPointerCapture(event.pointerId)) turn(event.movementX / 2, event.movementY / 2);
    });
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, -8], ArrowDown: [0, 8] };
      const step = by[/** @type {keyof typeof by} */ (event.key)];
      if (!step) return;
      turn(step[0], step[1]);
      event.preventDefault();
      event.stopPropagation();
    });
    new IntersectionObserver(([entry]) => {
      isSeen = entry.isIntersecting;
      ask();
    }).observe(canvas);
    image.replaceWith(canvas);

    if (!motions.length) return ask();
    const row = document.createElement("div");
    /** @param {string} text @param {(button: HTMLButtonElement) => void} act */
    const button = (text, act) => {
      const made = document.createElement("button");
      made.type = "button";
      made.textContent = text;
      made.addEventListener("click", () => act(made));
      row.append(made);
      return made;
    };
    const label = () => (state.moves ? "Pause" : "Play");
    button(label(), (own) => {
      state.moves = !state.moves;
      own.textContent = label();
      ask();
    });
    const choices = motions.map((name, n) =>
      button(name, () => {
        state.motion = n;
        choose();
        ask();
      }),
    );
    const choose = () =>
      choices.forEach((each, n) => each.setAttribute("aria-pressed", String(n === state.motion)));
    choose();
    host.append(row);
    ask();
  };

  for (const host of document.querySelectorAll(".carillon-solid:not([data-started])")) {
    host.setAttribute("data-started", "");
    // What fails leaves the still picture.
    start(/** @type {HTMLElement} */ (host)).catch(() => {});
  }
})();
