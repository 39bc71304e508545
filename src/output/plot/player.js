// Shows the snapshots of a run: what `player.rs` wrote into the page, drawn by WebGL, with axes and colour bar on a canvas above it.
"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const run = JSON.parse($("snapshots").textContent);
  const gl = $("scene").getContext("webgl", { antialias: true, stencil: true });
  if (!gl) {
    $("player").textContent = "This browser has no WebGL. particles.png shows the last snapshot.";
    return;
  }
  const packed = atob($("numbers").textContent);
  const bytes = new Uint8Array(packed.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = packed.charCodeAt(k);
  const numbers = new Uint16Array(bytes.buffer);
  const [count, last, flat] = [run.shown, run.times.length - 1, run.dimension < 3];
  const [rest, distance, displacement] = [run.channels.slice(0, 3), run.channels[3], run.channels.slice(4, 7)];

  // ---- values and colours ----

  const STEPS = 65534; // and one more for numbers that are none
  const value = (c, frame, p) => {
    if (c.start === null) return c.low;
    const q = numbers[c.start + frame * count + p];
    return q > STEPS ? NaN : c.low + (q / STEPS) * (c.high - c.low);
  };

  // What particles can be coloured by: the size of vectors and tensors, and every component that is not 0 throughout.
  const choices = [];
  for (const name of new Set(run.channels.slice(4).map((c) => c.field))) {
    const parts = run.channels.slice(4).filter((c) => c.field === name);
    if (parts.length > 1) {
      // Off the diagonal, the components of a symmetric tensor count twice.
      const weight = (k) => (parts.length === 6 && k > 2 ? 2 : 1);
      const size = (frame, p) => Math.sqrt(parts.reduce((sum, c, k) => sum + weight(k) * value(c, frame, p) ** 2, 0));
      choices.push({ label: `|${name}|`, at: size });
      if (name === "stress") {
        const mises = (frame, p) => {
          const [x, y, z, ...shear] = parts.map((c) => value(c, frame, p));
          const direct = (x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2;
          return Math.sqrt(direct / 2 + 3 * shear.reduce((sum, s) => sum + s * s, 0));
        };
        choices.push({ label: "von Mises stress", at: mises });
      }
    }
    for (const c of parts) {
      const there = parts.length === 1 || c.start !== null || c.low !== 0;
      if (there) choices.push({ label: `${name} ${c.component}`.trim(), at: (frame, p) => value(c, frame, p) });
    }
  }

  const rangeOf = (choice, from, to) => {
    let [low, high] = [Infinity, -Infinity];
    for (let frame = from; frame <= to; frame++) {
      for (let p = 0; p < count; p++) {
        const x = choice.at(frame, p);
        if (x < low) low = x;
        if (x > high) high = x;
      }
    }
    if (!(low <= high)) return [0, 1];
    // What does not vary is shown as such, not as its round-off.
    const least = 1e-6 * Math.max(Math.abs(low), Math.abs(high));
    return high - low > least ? [low, high] : [low - (least * 5e5 || 1), high + (least * 5e5 || 1)];
  };

  // ---- where one looks from ----

  const unit = (axis) => [0, 1, 2].map((k) => (k === axis ? 1 : 0));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const sum = (s, a, t, b) => a.map((x, k) => s * x + t * b[k]);
  const [right0, up0] = [unit(run.right), unit(run.up)];
  const toward0 = cross(right0, up0);
  // A box around all positions at all times.
  const low = rest.map((c, k) => c.low + Math.min(0, displacement[k].low));
  const high = rest.map((c, k) => c.high + Math.max(0, displacement[k].high));
  const centre = sum(0.5, low, 0.5, high);
  const reach = Math.hypot(...sum(1, high, -1, low)) || run.cell;
  // In one dimension the value itself goes up.
  const lift = run.dimension === 1 ? 0.6 * reach : 0;
  const view = { azimuth: 0, elevation: 0, zoom: 1, pan: [0, 0] };
  const axes = () => {
    const [ca, sa, ce, se] = [Math.cos(view.azimuth), Math.sin(view.azimuth), Math.cos(view.elevation), Math.sin(view.elevation)];
    const level = sum(ca, toward0, sa, right0);
    return { right: sum(ca, right0, -sa, toward0), up: sum(ce, up0, -se, level), toward: sum(ce, level, se, up0) };
  };
  const home = () => {
    Object.assign(view, flat ? { azimuth: 0, elevation: 0 } : { azimuth: 0.5, elevation: 0.35 }, { pan: [0, 0] });
    const { right, up } = axes();
    const extent = (axis) => sum(1, high, -1, low).reduce((s, x, k) => s + Math.abs(x * axis[k]), 0) + 2 * distance.high;
    const [wide, tall] = [extent(right), lift || extent(up)];
    view.zoom = 0.95 * Math.min((size.width - size.left - size.bar) / wide, (size.height - size.below - 20) / tall);
  };
  const project = (x, { right, up }) => {
    const d = sum(1, x, -1, centre);
    return [
      (size.left + size.width - size.bar) / 2 + view.zoom * (dot(d, right) + view.pan[0]),
      (size.height - size.below) / 2 - view.zoom * (dot(d, up) + view.pan[1]),
    ];
  };

  // ---- particles ----

  const VERTEX = `
    attribute float x, y, z, u, v, w, next, shade;
    uniform vec3 x_low, x_range, u_low, u_range, right, up, toward, paint, colours[9];
    uniform vec2 scale, shift, next_span, spot;
    uniform float deformation, depth, lift;
    varying vec3 colour;
    void main() {
      vec3 p = x_low + x_range * vec3(x, y, z) + deformation * (u_low + u_range * vec3(u, v, w));
      gl_Position = vec4(scale * (vec2(dot(right, p), dot(up, p) + lift * (shade - 0.5)) + shift), -dot(toward, p) * depth, 1.0);
      gl_PointSize = max(spot.x * (next_span.x + next_span.y * next), 3.0) + spot.y;
      float place = clamp(shade, 0.0, 1.0) * 8.0;
      int piece = int(min(floor(place), 7.0));
      colour = paint.r < 0.0 ? mix(colours[piece], colours[piece + 1], place - float(piece)) / 255.0 : paint;
      if (paint.r < 0.0 && shade < -0.5) colour = vec3(0.75);
    }`;
  const FRAGMENT = `
    precision mediump float;
    uniform float round, light;
    varying vec3 colour;
    void main() {
      vec2 at = 2.0 * gl_PointCoord - 1.0;
      float r2 = dot(at, at);
      if (round > 0.5 && r2 > 1.0) discard;
      float lit = light > 0.5 ? 0.55 + 0.45 * (sqrt(max(1.0 - r2, 0.0)) * 0.8 - at.y * 0.35 - at.x * 0.25) : 1.0;
      gl_FragColor = vec4(colour * min(lit, 1.0), 1.0);
    }`;
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  gl.useProgram(program);
  const uniform = (name) => gl.getUniformLocation(program, name);
  const set = (name, ...x) => gl[`uniform${x.length}f`](uniform(name), ...x);
  const all = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, all);
  gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
  const shades = { buffer: gl.createBuffer(), values: new Float32Array(count) };
  const triangles = gl.createBuffer();
  gl.uniform3fv(uniform("colours"), run.colours.flat());

  const attribute = (name, c, frame) => {
    const place = gl.getAttribLocation(program, name);
    if (c.start === null) {
      gl.disableVertexAttribArray(place);
      gl.vertexAttrib1f(place, 0);
    } else {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 1, gl.UNSIGNED_SHORT, true, 0, 2 * (c.start + frame * count));
    }
  };
  // The system's numbers go to 65535, ours to 65534.
  const spans = (channels) => channels.map((c) => ((c.high - c.low) * 65535) / STEPS);

  // Nothing of the scene is drawn outside: left, top, width and height.
  const frame = () => flat
    ? [size.left, 0, size.width - size.bar - size.left, size.height - size.below]
    : [0, 0, size.width - size.bar, size.height];

  // Obstacles and outlines that do not move are written once.
  const present = (list, frame) => list.slice(0, frame + 1).findLast((segments) => segments !== null) ?? [];

  // From here on only the inside of the bodies is drawn, if their outlines are known. The stencil counts how often the outlines go round a
  // pixel: every segment adds its triangle with the centre, or takes it away if the triangle is turned over.
  function cutByBodies() {
    const [start, now] = [present(run.bodies, 0), present(run.bodies, state.frame)];
    if (!flat || start.length === 0) return;
    const corners = new Float32Array((start.length / 4) * 12);
    const at = (list, k, i) => run.origin[i] + (list[k + i] * run.cell) / 1000;
    for (let k = 0, n = 0; k < start.length; k += 4) {
      // The centre, then both ends: place at the start, then displacement.
      n += 4;
      for (const end of [k, k + 2]) {
        for (const i of [0, 1]) corners[n++] = at(start, end, i) - centre[i];
        for (const i of [0, 1]) corners[n++] = at(now, end, i) - at(start, end, i);
      }
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, triangles);
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.DYNAMIC_DRAW);
    const place = (name) => gl.getAttribLocation(program, name);
    for (const name of ["z", "w", "next", "shade"]) {
      gl.disableVertexAttribArray(place(name));
      gl.vertexAttrib1f(place(name), 0);
    }
    ["x", "y", "u", "v"].forEach((name, k) => {
      gl.enableVertexAttribArray(place(name));
      gl.vertexAttribPointer(place(name), 1, gl.FLOAT, false, 16, 4 * k);
    });
    for (const name of ["x_low", "u_low"]) set(name, 0, 0, 0);
    for (const name of ["x_range", "u_range"]) set(name, 1, 1, 1);
    set("deformation", state.deformation);
    set("round", 0);
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.STENCIL_TEST);
    gl.colorMask(false, false, false, false);
    gl.stencilFunc(gl.ALWAYS, 0, 255);
    gl.stencilOpSeparate(gl.FRONT, gl.KEEP, gl.KEEP, gl.INCR_WRAP);
    gl.stencilOpSeparate(gl.BACK, gl.KEEP, gl.KEEP, gl.DECR_WRAP);
    gl.drawArrays(gl.TRIANGLES, 0, corners.length / 4);
    gl.colorMask(true, true, true, true);
    gl.stencilFunc(gl.NOTEQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
  }

  // The next draw shows particles.
  function particlesNext() {
    set("x_low", ...rest.map((c, k) => c.low - centre[k]));
    set("x_range", ...spans(rest));
    set("u_low", ...displacement.map((c) => c.low));
    set("u_range", ...spans(displacement));
    gl.bindBuffer(gl.ARRAY_BUFFER, all);
    ["x", "y", "z"].forEach((name, k) => attribute(name, rest[k], 0));
    attribute("next", distance, 0);
    ["u", "v", "w"].forEach((name, k) => attribute(name, displacement[k], state.frame));
    gl.bindBuffer(gl.ARRAY_BUFFER, shades.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, shades.values, gl.DYNAMIC_DRAW);
    const place = gl.getAttribLocation(program, "shade");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 1, gl.FLOAT, false, 0, 0);
  }

  function drawParticles() {
    const ratio = $("scene").width / size.width;
    gl.viewport(0, 0, $("scene").width, $("scene").height);
    gl.clearColor(1, 1, 1, 1);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.STENCIL_TEST);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    // From below, in pixels of the device.
    const [x, y, wide, tall] = frame();
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...[x, size.height - y - tall, wide, tall].map((length) => Math.round(length * ratio)));
    const { right, up, toward } = axes();
    set("right", ...right);
    set("up", ...up);
    set("toward", ...toward);
    const middle = project(centre, { right, up });
    set("scale", (2 * view.zoom) / size.width, (2 * view.zoom) / size.height);
    set("shift", (middle[0] - size.width / 2) / view.zoom, (size.height / 2 - middle[1]) / view.zoom);
    set("depth", 0.9 / (reach * Math.max(1, state.deformation)));
    set("next_span", distance.low, ...spans([distance]));
    set("lift", lift);
    particlesNext();
    // Spots as wide as neighbours are apart, and a little more: on a lattice they leave no gaps.
    const draw = (times, more, paint) => {
      set("spot", lift ? 0 : times * view.zoom * ratio, more * ratio);
      set("paint", ...paint);
      gl.drawArrays(gl.POINTS, 0, count);
    };
    set("light", 0);
    if ($("outline").checked && !lift) {
      // All spots in grey, then a little smaller in white: what stays is the rim of all together.
      gl.disable(gl.DEPTH_TEST);
      set("round", flat ? 0 : 1);
      set("deformation", 0);
      draw(flat ? 1.42 : 1.5, 4, [0.45, 0.45, 0.45]);
      draw(flat ? 1.42 : 1.5, 1, [1, 1, 1]);
    }
    cutByBodies();
    particlesNext();
    gl.enable(gl.DEPTH_TEST);
    set("round", 1);
    set("light", flat ? 0 : 1);
    set("deformation", state.deformation);
    draw(1.6, lift ? 3 : 0, [-1, 0, 0]);
  }

  // ---- axes and colour bar ----

  const shown = (x) => {
    if (Math.abs(x) < 1e-300) return "0";
    const text = Math.abs(x) >= 1e-3 && Math.abs(x) < 1e6 ? x.toPrecision(5) : x.toExponential(4);
    return text.includes(".") ? text.replace(/\.?0+(e|$)/, "$1") : text;
  };
  const ticks = (from, to, most) => {
    const raw = (to - from) / most;
    const ten = 10 ** Math.floor(Math.log10(raw));
    const step = ten * [1, 2, 5, 10].find((k) => k * ten >= raw * 0.999);
    const out = [];
    for (let k = Math.ceil(from / step); k * step <= to + 1e-9 * step; k++) out.push(k * step);
    return out;
  };

  function drawAxes(pen) {
    const now = axes();
    const line = (a, b) => {
      pen.beginPath();
      pen.moveTo(...a);
      pen.lineTo(...b);
      pen.stroke();
    };
    const end = run.origin.map((x, k) => x + run.cell * run.cells[k]);
    pen.save();
    pen.beginPath();
    pen.rect(...frame());
    pen.clip();
    if (!flat) {
      pen.strokeStyle = "rgba(0,0,0,.25)";
      for (let corner = 0; corner < 8; corner++) {
        const at = [0, 1, 2].map((k) => (corner & (1 << k) ? end[k] : run.origin[k]));
        for (let k = 0; k < 3; k++) {
          if (!(corner & (1 << k))) line(project(at, now), project(at.map((x, i) => (i === k ? end[i] : x)), now));
        }
      }
      const foot = [size.left, size.height - 40];
      ["x", "y", "z"].forEach((name, k) => {
        const tip = [foot[0] + 28 * now.right[k], foot[1] - 28 * now.up[k]];
        pen.strokeStyle = pen.fillStyle = ["#d55e00", "#009e73", "#0072b2"][k];
        line(foot, tip);
        pen.textAlign = "center";
        pen.fillText(name, foot[0] + 38 * now.right[k], foot[1] - 38 * now.up[k]);
      });
      pen.restore();
      return;
    }
    const [edge, floor] = [size.left, size.height - size.below];
    const world = (px, k) => (k === 0
      ? centre[0] - view.pan[0] + (px - (size.left + size.width - size.bar) / 2) / view.zoom
      : centre[1] - view.pan[1] - (px - (size.height - size.below) / 2) / view.zoom);
    const [x0, x1, y0, y1] = [world(edge, 0), world(size.width - size.bar, 0), world(floor, 1), world(0, 1)];
    if (!lift) {
      // The grid, as long as its lines are not a grey area.
      pen.strokeStyle = "rgba(0,0,0,.10)";
      for (const k of run.cell * view.zoom >= 5 ? [0, 1] : []) {
        const first = Math.max(0, Math.floor(((k ? y0 : x0) - run.origin[k]) / run.cell));
        const final = Math.min(run.cells[k], Math.ceil(((k ? y1 : x1) - run.origin[k]) / run.cell));
        for (let n = first; n <= final; n++) {
          const [a, b] = [run.origin.slice(), end.slice()];
          a[k] = b[k] = run.origin[k] + n * run.cell;
          line(project(a, now), project(b, now));
        }
      }
      pen.strokeStyle = "rgba(0,0,0,.5)";
      const [a, b] = [project(run.origin, now), project(end, now)];
      pen.strokeRect(a[0], b[1], b[0] - a[0], a[1] - b[1]);
      const outline = present(run.outlines, state.frame);
      const at = (k) => project([0, 1, 2].map((i) => (i < 2 ? run.origin[i] + (outline[k + i] * run.cell) / 1000 : 0)), now);
      [pen.strokeStyle, pen.lineWidth] = ["#000", 1.6];
      for (let k = 0; k + 3 < outline.length; k += 4) line(at(k), at(k + 2));
      pen.lineWidth = 1;
    }
    pen.restore();
    pen.strokeStyle = pen.fillStyle = "#444";
    line([edge, 0], [edge, floor]);
    line([edge, floor], [size.width - size.bar, floor]);
    pen.textAlign = "center";
    for (const x of ticks(x0, x1, 8)) {
      const px = project([x, centre[1], centre[2]], now)[0];
      line([px, floor], [px, floor + 4]);
      pen.fillText(shown(x), px, floor + 16);
    }
    pen.fillText("x", (edge + size.width - size.bar) / 2, floor + 32);
    pen.textAlign = "right";
    const height = (y) => lift
      ? project([0, centre[1], 0], now)[1] - view.zoom * lift * ((y - state.range[0]) / (state.range[1] - state.range[0]) - 0.5)
      : project([centre[0], y, centre[2]], now)[1];
    for (const y of lift ? ticks(...state.range, 6) : ticks(y0, y1, 6)) {
      line([edge - 4, height(y)], [edge, height(y)]);
      pen.fillText(shown(y), edge - 7, height(y) + 4);
    }
    pen.save();
    pen.translate(12, floor / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(lift ? choices[state.choice].label : "y", 0, 0);
    pen.restore();
  }

  function drawBar(pen) {
    const [x, top, wide, tall] = [size.width - size.bar + 24, 24, 16, size.height - 48 - size.below];
    const gradient = pen.createLinearGradient(0, top + tall, 0, top);
    run.colours.forEach((c, k) => gradient.addColorStop(k / 8, `rgb(${c})`));
    pen.fillStyle = gradient;
    pen.fillRect(x, top, wide, tall);
    pen.strokeStyle = pen.fillStyle = "#444";
    pen.textAlign = "left";
    const [from, to] = state.range;
    for (const y of ticks(from, to, 6)) {
      const py = top + tall * (1 - (y - from) / (to - from));
      pen.fillRect(x + wide, py, 4, 1);
      pen.fillText(shown(y), x + wide + 7, py + 4);
    }
    pen.save();
    pen.translate(size.width - 8, top + tall / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(choices[state.choice].label, 0, 0);
    pen.restore();
  }

  // ---- state and controls ----

  const size = { width: 0, height: 0, left: 64, below: 40, bar: 132 };
  const state = { frame: last, choice: 0, deformation: 1, range: [0, 1], playing: null };

  let due = false;
  function draw() {
    if (due) return;
    due = true;
    requestAnimationFrame(() => {
      due = false;
      drawParticles();
      const ratio = $("above").width / size.width;
      const pen = $("above").getContext("2d");
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, size.width, size.height);
      pen.font = "12px system-ui, sans-serif";
      drawAxes(pen);
      drawBar(pen);
    });
  }

  function colour() {
    const choice = choices[state.choice];
    if ($("now").checked) state.range = rangeOf(choice, state.frame, state.frame);
    else state.range = choice.range ??= rangeOf(choice, 0, last);
    const [from, to] = state.range;
    for (let p = 0; p < count; p++) {
      const x = choice.at(state.frame, p);
      shades.values[p] = Number.isNaN(x) ? -1 : (x - from) / (to - from);
    }
    draw();
  }

  function show(frame) {
    state.frame = frame;
    $("frame").value = frame;
    $("time").textContent = `t = ${shown(run.times[frame])}  (${frame + 1} of ${last + 1})`;
    colour();
  }

  function play(on) {
    clearInterval(state.playing);
    // The whole run in some six seconds.
    const pause = Math.min(250, Math.max(33, 6000 / (last + 1)));
    state.playing = on && last > 0 ? setInterval(() => show((state.frame + 1) % (last + 1)), pause) : null;
    $("play").textContent = state.playing === null ? "▶" : "❚❚";
    $("play").ariaLabel = state.playing === null ? "play" : "pause";
  }

  function resize() {
    const before = size.width;
    [size.width, size.height] = [$("above").clientWidth, $("above").clientHeight];
    for (const canvas of [$("scene"), $("above")]) {
      canvas.width = Math.round(size.width * devicePixelRatio);
      canvas.height = Math.round(size.height * devicePixelRatio);
    }
    if (!before) home();
    draw();
  }

  choices.forEach((choice, k) => $("field").add(new Option(choice.label, k)));
  // A field worth a look, or the first that was written and is more than where the particles went.
  const worth = ["plastic strain", "von Mises stress"].map((label) => choices.findIndex((choice) => choice.label === label));
  const other = choices.findIndex((choice) => !choice.label.includes("displacement"));
  state.choice = (run.dimension > 1 ? worth.find((k) => k >= 0) : undefined) ?? Math.max(0, other);
  $("field").value = state.choice;
  $("field").onchange = () => { state.choice = Number($("field").value); colour(); };
  $("now").onchange = colour;
  $("outline").onchange = draw;
  $("outline").parentElement.hidden = $("deformation").parentElement.hidden = lift > 0;
  $("deformation").oninput = () => {
    const x = Number($("deformation").value);
    if (Number.isFinite(x)) state.deformation = x;
    draw();
  };
  $("frame").max = last;
  $("frame").oninput = () => { play(false); show(Number($("frame").value)); };
  $("play").onclick = () => play(state.playing === null);
  $("home").onclick = () => { home(); draw(); };

  const canvas = $("above");
  const pressed = new Map();
  canvas.onpointerdown = (e) => { canvas.setPointerCapture(e.pointerId); pressed.set(e.pointerId, [e.offsetX, e.offsetY]); };
  canvas.onpointerup = canvas.onpointercancel = (e) => pressed.delete(e.pointerId);
  canvas.onpointermove = (e) => {
    const from = pressed.get(e.pointerId);
    if (!from || pressed.size > 1) return;
    const [dx, dy] = [e.offsetX - from[0], e.offsetY - from[1]];
    pressed.set(e.pointerId, [e.offsetX, e.offsetY]);
    if (flat || e.shiftKey) {
      view.pan = [view.pan[0] + dx / view.zoom, view.pan[1] - dy / view.zoom];
    } else {
      view.azimuth -= dx / 150;
      view.elevation = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, view.elevation + dy / 150));
    }
    draw();
  };
  canvas.addEventListener("wheel", (e) => {
    e.preventDefault();
    view.zoom *= Math.exp(-e.deltaY / 500);
    draw();
  }, { passive: false });

  addEventListener("resize", resize);
  resize();
  show(last);
})();
