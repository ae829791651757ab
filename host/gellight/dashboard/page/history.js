// Indentation over the last seconds, on the depth scale.

const SPAN_S = 15;

export class History {
  #canvas;
  #points = [];

  constructor(canvas) {
    this.#canvas = canvas;
  }

  /** Add an indentation in mm at `timeS`. */
  add(timeS, indentationMm) {
    if (this.#points.length && timeS < this.#points.at(-1).timeS) this.#points = []; // the sensor's clock was restarted
    this.#points.push({ timeS, indentationMm });
    while (this.#points[0].timeS < timeS - SPAN_S) this.#points.shift();
  }

  /** Draw all of it, the top of the canvas being `scaleUm`. */
  draw(scaleUm) {
    const ratio = devicePixelRatio;
    const [width, height] = [this.#canvas.clientWidth * ratio, this.#canvas.clientHeight * ratio];
    if (this.#canvas.width !== width || this.#canvas.height !== height) Object.assign(this.#canvas, { width, height });
    const context = this.#canvas.getContext("2d");
    context.clearRect(0, 0, width, height);
    grid(context, width, height);
    if (this.#points.length < 2) return;
    const now = this.#points.at(-1).timeS;
    const x = (point) => width * (1 - (now - point.timeS) / SPAN_S);
    const y = (point) => height - 1 - (height - 2) * Math.min((point.indentationMm * 1000) / scaleUm, 1);
    curve(context, this.#points.map((point) => [x(point), y(point)]), height, ratio);
  }
}

function grid(context, width, height) {
  context.fillStyle = "#0c1018";
  context.fillRect(0, 0, width, height);
  context.fillStyle = "#1b2332";
  for (let i = 1; i < 4; i++) context.fillRect(0, Math.round((height * i) / 4), width, 1);
  for (let i = 1; i < 3; i++) context.fillRect(Math.round((width * i) / 3), 0, 1, height);
}

function curve(context, points, height, ratio) {
  const path = new Path2D();
  points.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
  context.strokeStyle = "#4cc9c0";
  context.lineWidth = 1.5 * ratio;
  context.stroke(path);
  path.lineTo(points.at(-1)[0], height);
  path.lineTo(points[0][0], height);
  context.fillStyle = "#4cc9c026";
  context.fill(path);
}
