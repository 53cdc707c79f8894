// A light drawing of the arm, for as long as Rerun's viewer is on its way: it moves as the panel plays.

/** From where it is looked at, as the scene is: the angle from straight ahead, and the one above the ground, radians. */
const [AHEAD, ABOVE] = [-0.95, 0.2];
/** Directions of the picture: to the right, and up. */
const RIGHT = [-Math.sin(AHEAD), Math.cos(AHEAD), 0];
const UP = [-Math.sin(ABOVE) * Math.cos(AHEAD), -Math.sin(ABOVE) * Math.sin(AHEAD), Math.cos(ABOVE)];
/** How long a movement takes, ms. */
const GLIDE_MS = 260;
const SEEN = "#e6b422";

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const projected = (point) => [dot(point, RIGHT), -dot(point, UP)];
const between = (from, to, way) => from.map((value, axis) => value + (to[axis] - value) * way);

export class Sketch {
  #canvas;
  #words;
  /** The arms of the learners, step by step. */
  #steps = new Map();
  /** Whose arm is drawn: the first of the caption. */
  #learner = null;
  /** The arm that is drawn, the one that it moves to, and since when. */
  #from = null;
  #to = null;
  #since = 0;
  #frame = 0;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {HTMLElement} words where it is said what it shows
   */
  constructor(canvas, words) {
    [this.#canvas, this.#words] = [canvas, words];
    new ResizeObserver(() => this.#draw()).observe(canvas);
  }

  /** Takes in a message of the session. @param {string} text */
  take(text) {
    const { type, data } = JSON.parse(text);
    if (type !== "step") return;
    const arms = data.learners.filter(({ movement }) => movement?.estimated_skeleton_m?.length > 0);
    this.#steps.set(
      data.step,
      new Map(arms.map(({ name, movement }) => [name, {
        believed: movement.estimated_skeleton_m,
        truth: movement.true_skeleton_m ?? null,
        seen: movement.measured_marker_m ?? null,
        expected: movement.predicted_marker_m ?? null,
      }])),
    );
  }

  /** The learners that there are to draw: one of them is, and stays. @param {{name: string, colour: number[]}[]} learners */
  of(learners) {
    this.#learner = learners.find(({ name }) => name === this.#learner?.name) ?? learners[0] ?? null;
  }

  /** Draws a step, if there is an arm of it. @param {number} step @returns {boolean} whether there is */
  show(step) {
    const arm = this.#steps.get(step)?.get(this.#learner?.name);
    if (arm === undefined) return false;
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.#from = still || this.#to?.believed.length !== arm.believed.length ? arm : this.#now();
    [this.#to, this.#since] = [arm, performance.now()];
    this.#canvas.hidden = this.#words.hidden = false;
    this.#words.textContent = `${this.#learner.name}, step ${step}${arm.truth ? ": the true arm is grey" : ""}`;
    this.#run();
    return true;
  }

  /** Forgets a run. */
  clear() {
    this.#steps.clear();
    [this.#from, this.#to] = [null, null];
    this.#canvas.hidden = this.#words.hidden = true;
  }

  #way() {
    return Math.min((performance.now() - this.#since) / GLIDE_MS, 1);
  }

  /** The arm as it is drawn at the moment. */
  #now() {
    const [from, to, way] = [this.#from, this.#to, this.#way()];
    const moved = (name) => to[name]?.map((point, link) => between(from[name]?.[link] ?? point, point, way)) ?? null;
    return { ...to, believed: moved("believed"), truth: moved("truth") };
  }

  #run() {
    if (this.#frame !== 0) return;
    this.#frame = requestAnimationFrame(() => {
      this.#frame = 0;
      this.#draw();
      if (this.#to !== null && this.#way() < 1) this.#run();
    });
  }

  #draw() {
    const [canvas, to] = [this.#canvas, this.#to];
    if (to === null || canvas.hidden) return;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const scale = devicePixelRatio;
    [canvas.width, canvas.height] = [width * scale, height * scale];
    const pen = canvas.getContext("2d");
    const arm = this.#now();
    // The longest arm fits, whatever its posture: it turns about its first point.
    const middle = projected((arm.truth ?? arm.believed)[0]);
    const length = (points) => points.slice(1).reduce((sum, point, link) => sum + Math.hypot(...point.map((value, axis) => value - points[link][axis])), 0);
    const reach = Math.max(...[to.truth, to.believed].filter(Boolean).map(length), 1e-3);
    const unit = (0.45 * Math.min(width, height)) / reach;
    const at = (point) => projected(point).map((value, axis) => (value - middle[axis]) * unit + [width, height][axis] / 2);
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    [pen.lineCap, pen.lineJoin] = ["round", "round"];
    const line = (points, colour, thick) => {
      [pen.strokeStyle, pen.fillStyle, pen.lineWidth] = [colour, colour, thick];
      pen.beginPath();
      for (const point of points) pen.lineTo(...at(point));
      pen.stroke();
      for (const point of points) this.#dot(pen, at(point), thick * 0.75);
    };
    if (arm.truth !== null) line(arm.truth, "#808080", 9);
    line(arm.believed, `rgb(${this.#learner.colour.join(" ")})`, 6);
    // What was seen is where the movement ends.
    if (this.#way() === 1 && arm.seen !== null) {
      pen.fillStyle = SEEN;
      this.#dot(pen, at(arm.seen), 6);
    }
  }

  #dot(pen, [x, y], radius) {
    pen.beginPath();
    pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fill();
  }
}
