// The scene in 3D by WebGL: roads, bodies and lights, from behind the ego and from above.
// World axes: x and y on the ground, z up, metres.

const VERTEX = `
attribute vec3 position; attribute vec3 normal;
uniform mat4 camera, model; uniform vec3 colour; varying vec3 shade;
void main() {
  vec3 n = normalize(mat3(model) * normal);
  float light = 0.55 + 0.45 * max(0.0, dot(n, normalize(vec3(0.4, 0.3, 0.85))));
  shade = colour * light;
  gl_Position = camera * model * vec4(position, 1.0);
}`;
const FRAGMENT = `
precision mediump float; varying vec3 shade;
void main() { gl_FragColor = vec4(shade, 1.0); }`;

const PHASES = { Green: [0.2, 0.9, 0.4], Yellow: [1.0, 0.8, 0.1], Red: [1.0, 0.2, 0.15] };
const GRASS = [0.16, 0.22, 0.17], ASPHALT = [0.22, 0.23, 0.25], PAINT = [0.85, 0.87, 0.88];
const ADO = [1.0, 0.67, 0.29];
const SKY = [0.5, 0.6, 0.7, 1];
const DARK = [0.08, 0.09, 0.1], GLASS = [0.12, 0.16, 0.2];

// 4 × 4 matrices in column order, as WebGL has them.
const times = (a, b) => {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) {
    let sum = 0;
    for (let k = 0; k < 4; k++) sum += a[4 * k + r] * b[4 * c + k];
    out[4 * c + r] = sum;
  }
  return out;
};
const perspective = (fieldRad, aspect, near, far) => {
  const f = 1 / Math.tan(fieldRad / 2), d = near - far;
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / d, -1, 0, 0, 2 * far * near / d, 0]);
};
const flat = (halfWidth, aspect, near, far) => {
  const w = halfWidth, h = halfWidth / aspect, d = near - far;
  return new Float32Array([1 / w, 0, 0, 0, 0, 1 / h, 0, 0, 0, 0, 2 / d, 0, 0, 0, (far + near) / d, 1]);
};
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); };
const lookAt = (eye, target, up) => {
  const z = unit(minus(eye, target)), x = unit(cross(up, z)), y = cross(z, x);
  return new Float32Array([
    x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0,
    -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
};
/** Matrix of a pose: centre x y z and quaternion qx qy qz qw. */
const posed = ([x, y, z, i, j, k, w]) => new Float32Array([
  1 - 2 * (j * j + k * k), 2 * (i * j + k * w), 2 * (i * k - j * w), 0,
  2 * (i * j - k * w), 1 - 2 * (i * i + k * k), 2 * (j * k + i * w), 0,
  2 * (i * k + j * w), 2 * (j * k - i * w), 1 - 2 * (i * i + j * j), 0,
  x, y, z, 1]);
const boxAt = (centre, size) => new Float32Array([
  size[0], 0, 0, 0, 0, size[1], 0, 0, 0, 0, size[2], 0, centre[0], centre[1], centre[2], 1]);
export const headingOf = ([, , , i, j, k, w]) => Math.atan2(2 * (i * j + k * w), 1 - 2 * (j * j + k * k));

/** Parts of a figure, as shares of its box: [centre, size, colour or null for the body's own]. */
const FIGURES = {
  car: [
    [[0, 0, -0.12], [1, 0.96, 0.46], null], [[-0.05, 0, 0.3], [0.52, 0.82, 0.38], GLASS],
    [[-0.05, 0, 0.49], [0.44, 0.76, 0.03], null],
    [[0.3, 0, -0.38], [0.15, 1, 0.24], DARK], [[-0.3, 0, -0.38], [0.15, 1, 0.24], DARK]],
  van: [
    [[0, 0, 0.05], [1, 0.96, 0.8], null], [[0.42, 0, 0.22], [0.17, 0.9, 0.3], GLASS],
    [[0.3, 0, -0.4], [0.13, 1, 0.2], DARK], [[-0.3, 0, -0.4], [0.13, 1, 0.2], DARK]],
  truck: [
    [[-0.1, 0, 0.08], [0.78, 1, 0.84], null], [[0.4, 0, 0], [0.18, 0.96, 0.68], null],
    [[0.48, 0, 0.12], [0.03, 0.88, 0.26], GLASS],
    [[0.36, 0, -0.42], [0.08, 1, 0.16], DARK], [[-0.3, 0, -0.42], [0.2, 1, 0.16], DARK]],
  two_wheeler: [
    [[0, 0, -0.25], [0.95, 0.18, 0.4], DARK], [[-0.05, 0, 0.12], [0.3, 0.8, 0.5], null],
    [[0, 0, 0.42], [0.16, 0.4, 0.16], GLASS]],
  person: [
    [[0, 0, -0.25], [0.5, 0.6, 0.5], DARK], [[0, 0, 0.12], [0.6, 0.9, 0.34], null],
    [[0, 0, 0.42], [0.45, 0.45, 0.16], [0.85, 0.68, 0.55]]],
};

function cube() {
  const position = [], normal = [];
  for (let axis = 0; axis < 3; axis++) for (const side of [-1, 1]) {
    const n = [0, 0, 0]; n[axis] = side;
    const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    for (const [a, b] of [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]) {
      const p = [0, 0, 0]; p[axis] = side / 2; p[u] = a / 2; p[v] = b / 2;
      position.push(...p); normal.push(...n);
    }
  }
  return { position, normal };
}

/** A band along a polyline, in dashes of `dash` metres on and off if that is above 0. */
function ribbon(line, width, raised, dash) {
  const position = [], normal = [];
  let along = 0;
  const quad = (a, b) => {
    const left = unit([a[1] - b[1], b[0] - a[0], 0]).map((x) => x * width / 2);
    const at = (p, s) => [p[0] + s * left[0], p[1] + s * left[1], p[2] + raised];
    const [p, q, r, s] = [at(a, -1), at(b, -1), at(b, 1), at(a, 1)];
    for (const corner of [p, q, r, p, r, s]) { position.push(...corner); normal.push(0, 0, 1); }
  };
  for (let i = 0; i + 1 < line.length; i++) {
    const [a, b] = [line[i], line[i + 1]], length = Math.hypot(...minus(b, a));
    if (!dash) { quad(a, b); continue; }
    // Dashes begin at fixed distances along the whole line.
    for (let s = 0; s < length;) {
      const phase = (along + s) % (2 * dash), left = Math.min((phase < dash ? dash : 2 * dash) - phase, length - s);
      const step = Math.max(left, 1e-3), point = (t) => a.map((x, k) => x + (b[k] - x) * t / length);
      if (phase < dash) quad(point(s), point(Math.min(s + step, length)));
      s += step;
    }
    along += length;
  }
  return { position, normal };
}

/** The surface between the first and the last border of a road. */
function surface(borders) {
  const position = [], normal = [], [right, left] = [borders[0], borders[borders.length - 1]];
  const count = Math.min(right.length, left.length);
  for (let i = 0; i + 1 < count; i++) {
    const [p, q, r, s] = [right[i], right[i + 1], left[i + 1], left[i]];
    for (const corner of [p, q, r, p, r, s]) { position.push(corner[0], corner[1], corner[2]); normal.push(0, 0, 1); }
  }
  return { position, normal };
}

/** True if the processor draws, for which smooth edges cost more than the whole picture. */
function isSoftware() {
  const gl = document.createElement("canvas").getContext("webgl");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  return /swiftshader|llvmpipe|software/i.test(info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "");
}

export class Scene3d {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl", { antialias: !isSoftware(), alpha: false });
    this.gl = gl;
    if (!gl) throw new Error("this browser has no WebGL");
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(program, shader);
    }
    gl.linkProgram(program); gl.useProgram(program);
    this.at = {
      position: gl.getAttribLocation(program, "position"), normal: gl.getAttribLocation(program, "normal"),
      camera: gl.getUniformLocation(program, "camera"), model: gl.getUniformLocation(program, "model"),
      colour: gl.getUniformLocation(program, "colour"),
    };
    gl.enable(gl.DEPTH_TEST);
    this.cube = this.mesh(cube());
    this.fixed = [];
    this.fromAbove = false;
    /** Pixels per pixel of the screen, along an edge. */
    this.sharpness = 1;
  }

  mesh({ position, normal }) {
    const gl = this.gl, buffer = (data) => {
      const made = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, made);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(data), gl.STATIC_DRAW);
      return made;
    };
    return { position: buffer(position), normal: buffer(normal), count: position.length / 3 };
  }

  /** Takes what does not change in an episode. */
  setStage(stage) {
    this.stage = stage;
    this.ego = Math.max(0, stage.geometry.agents.findIndex((it) => it.role === "Ego"));
    this.setRoads(stage.geometry);
  }

  /** Takes the roads, which an adversary may lay while you drive. */
  setRoads(geometry) {
    for (const { mesh } of this.fixed) for (const part of ["position", "normal"]) this.gl.deleteBuffer(mesh[part]);
    // One mesh per colour, since every mesh is a call.
    const asphalt = { position: [], normal: [] }, paint = { position: [], normal: [] };
    const add = (all, { position, normal }) => {
      for (const value of position) all.position.push(value);
      for (const value of normal) all.normal.push(value);
    };
    [geometry.lane_borders_m, ...geometry.side_roads_m].forEach((borders) => {
      if (borders.length < 2) return;
      add(asphalt, surface(borders));
      borders.forEach((line, at) => {
        const outer = at === 0 || at === borders.length - 1;
        // Wider than true, so that none is lost between two pixels of the smaller picture.
        add(paint, ribbon(line, 0.25, 0.02, outer ? 0 : 3));
      });
    });
    for (const light of geometry.lights) add(paint, ribbon(light.stop_line_m, 0.4, 0.03, 0));
    this.fixed = [{ mesh: this.mesh(asphalt), colour: ASPHALT }, { mesh: this.mesh(paint), colour: PAINT }];
  }

  draw(mesh, model, colour) {
    const gl = this.gl;
    for (const name of ["position", "normal"]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh[name]);
      gl.enableVertexAttribArray(this.at[name]);
      gl.vertexAttribPointer(this.at[name], 3, gl.FLOAT, false, 0, 0);
    }
    gl.uniformMatrix4fv(this.at.model, false, model);
    gl.uniform3fv(this.at.colour, colour);
    gl.drawArrays(gl.TRIANGLES, 0, mesh.count);
  }

  drawAll(camera, bodies, lights, ground) {
    const gl = this.gl, same = boxAt([0, 0, 0], [1, 1, 1]);
    gl.uniformMatrix4fv(this.at.camera, false, camera);
    gl.disable(gl.CULL_FACE);
    // Behind everything, so that it hides no road that lies lower.
    const below = ground[2] - this.stage.geometry.agents[this.ego].size_m[2] / 2 - 0.6;
    gl.depthMask(false);
    this.draw(this.cube, boxAt([ground[0], ground[1], below], [4000, 4000, 1]), GRASS);
    gl.depthMask(true);
    for (const { mesh, colour } of this.fixed) this.draw(mesh, same, colour);
    bodies.forEach((body, at) => {
      const agent = this.stage.geometry.agents[at];
      if (!agent) return;
      // An adversary in the colour of the ego would be taken for it.
      const like = agent.role === "Ado" && String(agent.colour) === String(this.stage.geometry.agents[this.ego].colour);
      const pose = posed(body), own = like ? ADO : agent.colour.map((c) => c / 255);
      // A body that the ego does not see is the shadow of itself.
      const shown = (colour) => (this.seen?.[at] === false ? colour.map((c) => 0.2 * c + 0.24) : colour);
      for (const [centre, size, colour] of FIGURES[this.stage.figures[at]]) {
        const scaled = (v) => v.map((x, k) => x * agent.size_m[k]);
        this.draw(this.cube, times(pose, boxAt(scaled(centre), scaled(size))), shown(colour ?? own));
      }
    });
    this.stage.geometry.lights.forEach((light, at) => {
      // The post stands at the right end of its stop line.
      const [x, y, z] = light.stop_line_m[0], colour = PHASES[lights[at]] ?? DARK;
      this.draw(this.cube, boxAt([x, y, z + 1.6], [0.12, 0.12, 3.2]), DARK);
      this.draw(this.cube, boxAt([x, y, z + 3.2], [0.6, 0.6, 0.9]), colour);
    });
  }

  /** Cameras that follow a body: from behind it, and from above with its way to the right. */
  cameras(body) {
    const [x, y, z] = body, heading = headingOf(body), ahead = [Math.cos(heading), Math.sin(heading)];
    const at = (along, up) => [x + along * ahead[0], y + along * ahead[1], z + up];
    const chase = lookAt(at(-13, 5.5), at(14, 0), [0, 0, 1]);
    const over = lookAt(at(12, 200), at(12, 0), [-ahead[1], ahead[0], 0]);
    return {
      behind: (aspect) => times(perspective(1.0, aspect, 0.5, 3000), chase),
      above: (aspect, half) => times(flat(half, aspect, 1, 600), over),
    };
  }

  /** Draws the bodies at their poses, and returns where the top of each is on the canvas.
   *  `seen` has whether the ego sees each body, or is absent if nothing can hide one. */
  show(bodies, lights, seen) {
    this.seen = seen;
    const gl = this.gl, canvas = this.canvas, ratio = this.sharpness * (window.devicePixelRatio || 1);
    const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const body = bodies[this.ego] ?? bodies[0];
    if (!body || !width || !height) return [];
    const cameras = this.cameras(body), aspect = width / height;
    const main = this.fromAbove ? cameras.above(aspect, 60) : cameras.behind(aspect);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(...SKY);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.drawAll(main, bodies, lights, body);
    const [w, h] = [Math.round(width * 0.42), Math.round(height * 0.24)], gap = Math.round(12 * ratio);
    // In a small window below would be upon the ego.
    const inset = [width - w - gap, canvas.clientWidth < 600 ? height - h - gap : gap, w, h];
    gl.viewport(...inset);
    gl.enable(gl.SCISSOR_TEST);
    // A frame, and the smaller picture within it.
    gl.scissor(inset[0] - 2, inset[1] - 2, w + 4, h + 4);
    gl.clearColor(0.07, 0.09, 0.11, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.scissor(...inset);
    gl.clearColor(...SKY);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const small = this.fromAbove ? cameras.behind(w / h) : cameras.above(w / h, 45);
    this.drawAll(small, bodies, lights, body);
    return bodies.map((it, at) => this.onCanvas(main, [it[0], it[1], it[2] + (this.stage.geometry.agents[at]?.size_m[2] ?? 1.5) * 0.6]));
  }

  onCanvas(camera, [x, y, z]) {
    const row = (r) => camera[r] * x + camera[4 + r] * y + camera[8 + r] * z + camera[12 + r];
    const w = row(3);
    if (w <= 0) return null;
    const [u, v] = [row(0) / w, row(1) / w];
    if (Math.abs(u) > 1.1 || Math.abs(v) > 1.1) return null;
    return [(u + 1) / 2 * this.canvas.clientWidth, (1 - v) / 2 * this.canvas.clientHeight];
  }
}
