// The scene in 3D on a 2D canvas: roads, bodies and lights, from behind the ego and from above.
// World axes: x and y on the ground, z up, metres.
//
// What is farther away is drawn first. A depth buffer would need WebGL, which browsers on
// machines without a graphics card either lack or emulate too slowly for 60 pictures a second.

const PHASES = { Green: [0.2, 0.9, 0.4], Yellow: [1.0, 0.8, 0.1], Red: [1.0, 0.2, 0.15] };
const GRASS = [0.16, 0.22, 0.17], ASPHALT = [0.22, 0.23, 0.25], PAINT = [0.85, 0.87, 0.88];
const ADO = [1.0, 0.67, 0.29];
const SKY = [0.5, 0.6, 0.7], FRAME = [0.07, 0.09, 0.11];
const DARK = [0.08, 0.09, 0.1], GLASS = [0.12, 0.16, 0.2];

/** Least distance in front of a camera at which anything is drawn. */
const NEAR_M = 0.5;
/** Greatest distance of a road with slopes. */
const FAR_M = 600;
/** Distance of two stations on a road with slopes, whose pieces are drawn one by one. */
const STATION_M = 4;

const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); };
export const headingOf = ([, , , i, j, k, w]) => Math.atan2(2 * (i * j + k * w), 1 - 2 * (j * j + k * k));
/** Axes of a pose, of centre x y z and quaternion qx qy qz qw: where its x, y and z point. */
const axesOf = ([, , , i, j, k, w]) => [
  [1 - 2 * (j * j + k * k), 2 * (i * j + k * w), 2 * (i * k - j * w)],
  [2 * (i * j - k * w), 1 - 2 * (i * i + k * k), 2 * (j * k + i * w)],
  [2 * (i * k + j * w), 2 * (j * k - i * w), 1 - 2 * (i * i + j * j)],
];
const WORLD = axesOf([0, 0, 0, 0, 0, 0, 1]);

/** Where the light comes from. */
const SUN = unit([0.4, 0.3, 0.85]);
const lit = (normal) => 0.55 + 0.45 * Math.max(0, dot(normal, SUN));
const UP = lit([0, 0, 1]);
/** Texts of colours, so that no picture makes a new one. */
const texts = new Map();
function paint([r, g, b], light) {
  const byte = (share) => Math.min(255, Math.round(255 * share * light));
  const key = byte(r) << 16 | byte(g) << 8 | byte(b);
  if (!texts.has(key)) texts.set(key, `#${key.toString(16).padStart(6, "0")}`);
  return texts.get(key);
}

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

/** Boxes of a figure: least and greatest corner in metres, and colour. */
const boxesOf = (figure, size) => FIGURES[figure].map(([centre, extent, colour]) => ({
  least: centre.map((c, k) => (c - extent[k] / 2) * size[k]),
  most: centre.map((c, k) => (c + extent[k] / 2) * size[k]),
  colour,
}));
const box = (centre, size, colour) => ({
  least: centre.map((c, k) => c - size[k] / 2), most: centre.map((c, k) => c + size[k] / 2), colour,
});

/** True if one box cannot hide another from an eye, in the axes of both. */
function isBehind(one, other, eye) {
  let overlaps = true;
  for (let k = 0; k < 3; k++) {
    if (one.most[k] <= other.least[k]) { overlaps = false; if (eye[k] >= other.least[k]) return true; }
    if (other.most[k] <= one.least[k]) { overlaps = false; if (eye[k] <= other.most[k]) return true; }
  }
  // Of two that overlap, the lower one, since cameras look down.
  return overlaps && one.least[2] + one.most[2] <= other.least[2] + other.most[2];
}

/** Adds the quads of a band along a polyline, each with the number of its segment.
 *  It is in dashes of `dash` metres on and off if that is above 0. */
function ribbon(line, width, raised, dash, add) {
  let along = 0;
  const quad = (i, a, b) => {
    const left = unit([a[1] - b[1], b[0] - a[0], 0]).map((x) => x * width / 2);
    const at = (p, s) => [p[0] + s * left[0], p[1] + s * left[1], p[2] + raised];
    add(i, [at(a, -1), at(b, -1), at(b, 1), at(a, 1)]);
  };
  for (let i = 0; i + 1 < line.length; i++) {
    const [a, b] = [line[i], line[i + 1]], length = Math.hypot(...minus(b, a));
    if (!dash) { quad(i, a, b); continue; }
    // Dashes begin at fixed distances along the whole line.
    for (let s = 0; s < length;) {
      const phase = (along + s) % (2 * dash), left = Math.min((phase < dash ? dash : 2 * dash) - phase, length - s);
      const step = Math.max(left, 1e-3), point = (t) => a.map((x, k) => x + (b[k] - x) * t / length);
      if (phase < dash) quad(i, point(s), point(Math.min(s + step, length)));
      s += step;
    }
    along += length;
  }
}

/** Borders of a road at stations of equal distances, as far as their own stations allow. */
function stationed(borders) {
  const places = [];
  let left = 0;
  borders[0].forEach((point, i, line) => {
    if (i + 1 === line.length) { places.push([i - 1, 1]); return; }
    const length = Math.hypot(...minus(line[i + 1], point));
    for (; left < length; left += STATION_M) places.push([i, left / length]);
    left -= length;
  });
  return borders.map((line) => places.map(([i, share]) => line[i].map((x, k) => x + share * (line[i + 1][k] - x))));
}

/** A camera: from points of the world to those of its part of the canvas. */
class Camera {
  /** `field` is the angle of view in radians, or the half width in metres of a flat picture. */
  constructor(eye, target, up, field, isFlat) {
    this.z = unit(minus(eye, target)); this.x = unit(cross(up, this.z)); this.y = cross(this.z, this.x);
    this.eye = eye; this.field = field; this.isFlat = isFlat;
    /** The last projected point: place on the canvas and depth. */
    this.u = this.v = this.depth = 0;
  }
  /** Places the picture on the canvas. */
  on(left, top, width, height) {
    this.view = [left, top, width, height];
    this.middle = [left + width / 2, top + height / 2];
    this.scale = this.isFlat ? width / 2 / this.field : height / 2 / Math.tan(this.field / 2);
  }
  /** Projects a point, and returns whether it is far enough in front of the camera. */
  project(px, py, pz) {
    const x = px - this.eye[0], y = py - this.eye[1], z = pz - this.eye[2];
    this.depth = -(this.z[0] * x + this.z[1] * y + this.z[2] * z);
    const scale = this.isFlat ? this.scale : this.scale / Math.max(this.depth, 1e-6);
    this.u = this.middle[0] + scale * (this.x[0] * x + this.x[1] * y + this.x[2] * z);
    this.v = this.middle[1] - scale * (this.y[0] * x + this.y[1] * y + this.y[2] * z);
    return this.depth >= NEAR_M;
  }
}

export class Scene3d {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d", { alpha: false });
    this.fromAbove = false;
    /** Pixels per pixel of the screen, along an edge. */
    this.sharpness = 1;
    /** Corners of a box on the canvas. */
    this.corners = new Float64Array(16);
  }

  /** Takes what does not change in an episode. */
  setStage(stage) {
    this.stage = stage;
    const { agents } = stage.geometry;
    this.ego = Math.max(0, agents.findIndex((it) => it.role === "Ego"));
    this.boxes = agents.map((agent, at) => boxesOf(stage.figures[at], agent.size_m));
    this.colours = agents.map((agent) => {
      // An adversary in the colour of the ego would be taken for it.
      const like = agent.role === "Ado" && String(agent.colour) === String(agents[this.ego].colour);
      return like ? ADO : agent.colour.map((c) => c / 255);
    });
    this.setRoads(stage.geometry);
  }

  /** Takes the roads, which an adversary may lay while you drive. */
  setRoads(geometry) {
    const roads = [geometry.lane_borders_m, ...geometry.side_roads_m].filter((borders) => borders.length > 1);
    const height = roads[0]?.[0][0][2] ?? 0;
    /** A road that rises hides what is behind it, so its pieces are drawn among the bodies. */
    this.isFlat = roads.every((borders) => borders.every((line) => line.every((point) => point[2] === height)));
    this.pieces = [];
    for (const borders of roads) {
      const lines = this.isFlat ? borders : stationed(borders);
      const [right, left] = [lines[0], lines.at(-1)], first = this.pieces.length;
      if (this.isFlat) this.pieces.push({ asphalt: [...right, ...[...left].reverse()], paint: [] });
      else for (let i = 0; i + 1 < right.length; i++) {
        this.pieces.push({ asphalt: [right[i], right[i + 1], left[i + 1], left[i]], paint: [] });
      }
      lines.forEach((line, at) => {
        const outer = at === 0 || at === lines.length - 1;
        // Wider than true, so that none is lost between two pixels of the smaller picture.
        ribbon(line, 0.25, 0.02, outer ? 0 : 3, (i, quad) => this.pieces[this.isFlat ? first : first + i].paint.push(quad));
      });
    }
    for (const light of geometry.lights) {
      ribbon(light.stop_line_m, 0.4, 0.03, 0, (_, quad) => this.pieces.push({ paint: [quad] }));
    }
    // The posts stand at the right ends of the stop lines.
    this.posts = geometry.lights.map(({ stop_line_m: [[x, y, z]] }) => [
      box([x, y, z + 1.6], [0.12, 0.12, 3.2], DARK), box([x, y, z + 3.2], [0.6, 0.6, 0.9], null)]);
  }

  /** Adds the part of a polygon in front of the camera to the path, which a fill closes. */
  trace(camera, points) {
    const { pen } = this, count = points.length;
    let begun = false;
    const to = () => {
      if (begun) pen.lineTo(camera.u, camera.v); else pen.moveTo(camera.u, camera.v);
      begun = true;
    };
    for (let i = 0; i < count; i++) {
      const a = points[i], b = points[(i + 1) % count];
      const isHere = camera.project(a[0], a[1], a[2]), depth = camera.depth;
      if (isHere) to();
      if (isHere !== camera.project(b[0], b[1], b[2])) {
        const share = (NEAR_M * 1.001 - depth) / (camera.depth - depth);
        camera.project(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]));
        to();
      }
    }
  }

  fill(camera, polygons, colour) {
    const { pen } = this;
    pen.fillStyle = paint(colour, UP);
    pen.beginPath();
    for (const points of polygons) this.trace(camera, points);
    pen.fill();
  }

  /** Fills pieces of road, with their paint on top. */
  fillPieces(camera, pieces) {
    this.fill(camera, pieces.flatMap((it) => (it.asphalt ? [it.asphalt] : [])), ASPHALT);
    this.fill(camera, pieces.flatMap((it) => it.paint), PAINT);
  }

  /** False for a piece of road behind a crest, whose lower side would be seen. */
  isSeen(camera, { asphalt }) {
    if (!asphalt) return true;
    let area = 0;
    for (let i = 0; i < 4; i++) {
      const a = asphalt[i], b = asphalt[(i + 1) % 4];
      if (!camera.project(a[0], a[1], a[2])) return true;
      const { u, v } = camera;
      camera.project(b[0], b[1], b[2]);
      area += u * camera.v - v * camera.u;
    }
    return area < 0;
  }

  /** Draws boxes that share the axes of a body, the farthest first. */
  drawBoxes(camera, centre, axes, boxes, colourOf) {
    const { pen, corners } = this, away = minus(camera.eye, centre);
    const eye = axes.map((axis) => dot(away, axis)), waiting = [...boxes];
    while (waiting.length) {
      const isFree = (one) => waiting.every((other) => other === one || isBehind(one, other, eye));
      const [it] = waiting.splice(Math.max(0, waiting.findIndex(isFree)), 1);
      let isWhole = true;
      for (let corner = 0; corner < 8; corner++) {
        const local = [0, 1, 2].map((k) => (corner >> k & 1 ? it.most[k] : it.least[k]));
        const at = (k) => centre[k] + axes[0][k] * local[0] + axes[1][k] * local[1] + axes[2][k] * local[2];
        isWhole = camera.project(at(0), at(1), at(2)) && isWhole;
        corners[2 * corner] = camera.u; corners[2 * corner + 1] = camera.v;
      }
      if (!isWhole) continue;
      const colour = colourOf(it);
      for (let k = 0; k < 3; k++) for (const side of [0, 1]) {
        // A face is seen from its own side only.
        if (side ? eye[k] <= it.most[k] : eye[k] >= it.least[k]) continue;
        const [u, v] = [1 << (k + 1) % 3, 1 << (k + 2) % 3], from = side << k;
        pen.fillStyle = paint(colour, lit(side ? axes[k] : axes[k].map((x) => -x)));
        pen.beginPath();
        for (const corner of [from, from + u, from + u + v, from + v]) pen.lineTo(corners[2 * corner], corners[2 * corner + 1]);
        pen.fill();
      }
    }
  }

  drawAll(camera, bodies, lights) {
    const { pen, stage } = this, [left, top, width, height] = camera.view;
    pen.fillStyle = paint(SKY, 1);
    pen.fillRect(left, top, width, height);
    const [x, y, z] = bodies[this.ego] ?? bodies[0], low = z - stage.geometry.agents[this.ego].size_m[2] / 2 - 0.1;
    const grass = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => [x + 2000 * a, y + 2000 * b, low]);
    this.fill(camera, [grass], GRASS);
    const items = [];
    // From above no road hides anything.
    if (this.isFlat || camera.isFlat) this.fillPieces(camera, this.pieces);
    else for (const piece of this.pieces) {
      const at = (piece.asphalt ?? piece.paint[0])[0];
      camera.project(at[0], at[1], at[2]);
      const depth = camera.depth - (piece.asphalt ? 0 : STATION_M);
      if (depth > -STATION_M && depth < FAR_M) items.push({ depth, piece });
    }
    bodies.forEach((body, at) => {
      const agent = stage.geometry.agents[at];
      if (!agent) return;
      camera.project(body[0], body[1], body[2]);
      // A body that the ego does not see is the shadow of itself.
      const shown = (colour) => (this.seen?.[at] === false ? colour.map((c) => 0.2 * c + 0.24) : colour);
      const colourOf = (part) => shown(part.colour ?? this.colours[at]);
      // From its nearest end on, since the road below it is no nearer than that.
      const act = () => this.drawBoxes(camera, body, axesOf(body), this.boxes[at], colourOf);
      items.push({ depth: camera.depth - agent.size_m[0] / 2 - (this.isFlat ? 0 : STATION_M), act });
    });
    this.posts.forEach((post, at) => {
      const colour = PHASES[lights[at]] ?? DARK;
      camera.project(...post[0].least);
      const act = () => this.drawBoxes(camera, [0, 0, 0], WORLD, post, (part) => part.colour ?? colour);
      items.push({ depth: camera.depth, act });
    });
    items.sort((a, b) => b.depth - a.depth);
    // Pieces with nothing between them are one shape, without seams.
    const joined = [];
    const flush = () => { if (joined.length) this.fillPieces(camera, joined.splice(0)); };
    for (const { piece, act } of items) {
      if (piece && this.isSeen(camera, piece)) { joined.push(piece); continue; }
      flush();
      act?.();
    }
    flush();
  }

  /** Cameras that follow a body: from behind it, and from above with its way to the right. */
  camera(body, isAbove, half) {
    const [x, y, z] = body, heading = headingOf(body), ahead = [Math.cos(heading), Math.sin(heading)];
    const at = (along, up) => [x + along * ahead[0], y + along * ahead[1], z + up];
    return isAbove
      ? new Camera(at(12, 200), at(12, 0), [-ahead[1], ahead[0], 0], half, true)
      : new Camera(at(-13, 5.5), at(14, 0), [0, 0, 1], 1.0, false);
  }

  /** Draws the bodies at their poses, and returns where the top of each is on the canvas.
   *  `seen` has whether the ego sees each body, or is absent if nothing can hide one. */
  show(bodies, lights, seen) {
    this.seen = seen;
    const { canvas, pen } = this, ratio = this.sharpness * (window.devicePixelRatio || 1);
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
    const [width, height] = [Math.round(wide * ratio), Math.round(high * ratio)];
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    const body = bodies[this.ego] ?? bodies[0];
    if (!body || !width || !height) return [];
    const main = this.camera(body, this.fromAbove, 60), small = this.camera(body, !this.fromAbove, 45);
    main.on(0, 0, width, height);
    this.drawAll(main, bodies, lights);
    const [w, h] = [Math.round(width * 0.42), Math.round(height * 0.24)], gap = Math.round(12 * ratio);
    // In a small window below would be upon the ego.
    const [left, top] = [width - w - gap, wide <= 600 ? gap : height - h - gap];
    pen.fillStyle = paint(FRAME, 1);
    pen.fillRect(left - 2, top - 2, w + 4, h + 4);
    pen.save();
    pen.beginPath(); pen.rect(left, top, w, h); pen.clip();
    small.on(left, top, w, h);
    this.drawAll(small, bodies, lights);
    pen.restore();
    return bodies.map((it, at) => {
      const above = (this.stage.geometry.agents[at]?.size_m[2] ?? 1.5) * 0.6;
      if (!main.project(it[0], it[1], it[2] + above)) return null;
      const [u, v] = [main.u / ratio, main.v / ratio];
      return u < -0.05 * wide || u > 1.05 * wide || v < -0.05 * high || v > 1.05 * high ? null : [u, v];
    });
  }
}
