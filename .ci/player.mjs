// The player of a report, run without a browser: node .ci/player.mjs report.html SNAPSHOTS
// The page's elements, WebGL and the pen are stubs that count; what is checked is what the player reads, offers and hands to them.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import vm from "node:vm";

const [file, snapshots] = process.argv.slice(2);
const page = readFileSync(file, "utf8");
const script = (open) => page.split(`${open}>`)[1].split("</script>")[0];
const run = JSON.parse(script('<script type="application/json" id="snapshots"'));
assert.equal(run.times.length, Number(snapshots));

const drawn = [];
// Triangles by which spots are cut at the outlines of the bodies.
const cut = [];
const uploads = [];
const frames_of_particles = [];
// Strokes of the pen, in their order.
const strokes = [];
const gl = new Proxy({}, {
  get: (_, name) => {
    if (name === "bufferData") return (_target, data) => uploads.push(data.slice());
    if (name === "scissor") return (...frame) => frames_of_particles.push(frame);
    if (name === "drawArrays") return (kind, _first, count) => (kind === "POINTS" ? drawn : cut).push(count);
    if (name === "getProgramParameter") return () => true;
    return name === name.toUpperCase() ? name : () => ({});
  },
});
const pen = new Proxy({}, {
  get: (_, name) => (name === "createLinearGradient" ? () => ({ addColorStop() {} }) : (...where) => strokes.push([name, ...where])),
  set: () => true,
});
const texts = { snapshots: JSON.stringify(run), numbers: script('<script type="text/plain" id="numbers"') };
const elements = {};
const element = (id) => elements[id] ??= {
  textContent: texts[id] ?? "", checked: id === "outline", value: "", options: [], parentElement: {},
  clientWidth: 960, clientHeight: 560, addEventListener() {}, getContext: (kind) => (kind === "webgl" ? gl : pen),
  add(option) { this.options.push(option.text); },
};
const frames = [];
const world = {
  document: { getElementById: element }, atob, devicePixelRatio: 1, addEventListener() {}, setInterval, clearInterval,
  Option: class { constructor(text) { this.text = text; } }, requestAnimationFrame: (callback) => frames.push(callback),
};
const draw = () => frames.splice(0).forEach((callback) => callback());

const code = page.split("<script>").at(-1).split("</script>")[0];
vm.runInNewContext(code, world);
draw();
assert.ok(element("field").options.length >= 2, "fields to choose from");
// Grid and particles stay inside one frame.
const [left, top, wide, tall] = strokes.find(([name]) => name === "rect").slice(1);
const names = strokes.map(([name]) => name);
assert.ok(names.indexOf("clip") >= 0 && names.indexOf("clip") < names.indexOf("lineTo"), "lines are clipped");
assert.deepEqual(frames_of_particles[0], [left, 560 - top - tall, wide, tall]);
assert.ok(left + wide < 960 - 100, "the frame leaves room for the colour bar");
// Where there is a stress, it is what is shown first.
const first = element("field").options[element("field").value];
if (run.dimension > 1 && run.channels.some((c) => c.field === "stress")) assert.match(first, /von Mises|plastic/);
assert.ok(drawn.length === 3 && drawn.every((count) => count === run.shown), `${drawn}`);
assert.deepEqual(cut, run.bodies[0] ? [(run.bodies[0].length / 4) * 3] : []);
const shades = () => uploads.filter((data) => data.constructor.name === "Float32Array").at(-1);
element("field").options.forEach((label, k) => {
  // Colours over all times reach from 0 to 1 somewhere, and those of one time there; what does not vary lies in the middle.
  element("field").value = k;
  element("field").onchange();
  const [least, most] = [[], []];
  for (let frame = 0; frame < run.times.length; frame++) {
    element("frame").value = frame;
    element("frame").oninput();
    draw();
    least.push(shades().reduce((a, b) => Math.min(a, b)));
    most.push(shades().reduce((a, b) => Math.max(a, b)));
  }
  // Nothing has moved in the first snapshot.
  if (label === "|displacement|") assert.ok(most[0] < 1e-3, `${label} at the start: ${most[0]}`);
  const [low, high] = [Math.min(...least), Math.max(...most)];
  const still = Math.abs(low - 0.5) < 1e-3 && Math.abs(high - 0.5) < 1e-3;
  assert.ok(still || (Math.abs(low) < 1e-6 && Math.abs(high - 1) < 1e-6), `${label}: ${low} to ${high}`);
});
assert.match(element("time").textContent, new RegExp(`\\(${run.times.length} of ${run.times.length}\\)`));
console.log(`player: ${run.shown} particles, ${run.times.length} snapshots, ${element("field").options.join(", ")}`);
