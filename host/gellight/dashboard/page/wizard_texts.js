// The words of the wizard: names of steps, actions, pictures and figures, and what is said where a hand is virtual.

export const NAMES = {
  step: {
    prepare: "Prepare", reference: "Reference", pixel_size: "Pixel size", presses: "Ball presses", fit: "Fit",
    verify: "Verify",
  },
  action: { start: "Start", next: "Next", drop: "Drop this press", accept: "Accept", abort: "Stop" },
  picture: {
    live: "Live", press: "Last press", difference: "Last press, difference", cylinder: "Cylinder",
    verify: "Depth of the check", untouched: "Untouched gel",
  },
};

const BY_HAND = "You need a ball and a flat-ended cylinder of known size, and a quarter of an hour. "
  + "Let the sensor warm up, and clean the gel.";
const BY_VIRTUAL_HAND = "The sensor is simulated: a virtual hand presses everything. "
  + "You need nothing but some minutes.";
const HAND_DOES = {
  pixel_size: "The virtual hand presses the cylinder, each time at another place.",
  presses: "The virtual hand presses the ball, from a light touch to 2 mm deep, all over the view.",
  verify: "The virtual hand presses the ball at fresh places: these presses judge the calibration and are not learnt "
    + "from.",
};

/** What to do now, in the words of who presses. */
export function instruction(state, routine, running) {
  if (running && state.hand && HAND_DOES[routine.step]) return HAND_DOES[routine.step];
  if (routine?.instruction) return routine.instruction;
  if (running) return "One moment…";
  if (state.interrupted) return "A calibration was interrupted. Start to go on where it stopped.";
  return state.simulated ? BY_VIRTUAL_HAND : BY_HAND;
}

/** What is missing most; nobody can follow it where a virtual hand presses. */
export function advice(state, routine, running) {
  if (!running || routine.step !== "presses" || state.hand) return "";
  return routine.advice === "enough" ? "Enough: go on when you like." : routine.advice;
}

/** What is published of a kind of sensor, and what is not. */
export function presetNote({ title, view_mm: view, ball_radius_mm: ball, lights }) {
  const seen = view ? `shows ${view[0]} x ${view[1]} mm of gel` : "shows an area that is not known";
  const usual = ball ? `was calibrated with a ball of ${ball} mm` : "has no usual ball";
  return `${title} ${seen}, ${usual}; lights: ${lights}. Let the cylinder measure the pixel size unless you know it.`;
}

const unit = (digits, unit, times = 1) => (value) => `${(times * value).toFixed(digits)}${unit}`;

/** Step, where it says the figure, name, and how it is written. */
const FIGURES = [
  ["prepare", "uniformity.average.sigma_grey", "evenness of the light (σ)", unit(1, " grey")],
  ["prepare", "camera.exposure_us", "exposure", unit(2, " ms", 1e-3)],
  ["reference", "noise_grey", "noise of a pixel", unit(2, " grey")],
  ["reference", "drift_grey", "drift while warm", unit(3, " grey")],
  ["pixel_size", "x_mm", "pixel size, x", unit(2, " µm", 1000)],
  ["pixel_size", "y_mm", "pixel size, y", unit(2, " µm", 1000)],
  ["pixel_size", "spread_px", "cylinder, spread of the diameter", unit(3, " px")],
  ["fit", "held_out.normal_error_deg.mean", "normal error, presses not learnt from", unit(2, "°")],
  ["fit", "training.unlikeness", "the like unit's presses alone, slopes off by", unit(0, " %", 100)],
  ["fit", "training.cpu_seconds", "training", unit(1, " CPU s")],
  ["verify", "true_depth_mm", "depth error in contact, fresh presses", unit(1, " µm", 1000)],
  ["verify", "depth_mm", "of it in the shape (the mean of each press is off)", unit(1, " µm", 1000)],
  ["verify", "normal_deg", "normal error, fresh presses", unit(2, "°")],
];

/** Return [name, text] for each figure that is known. */
export function figureRows(figures) {
  return FIGURES.flatMap(([step, path, name, write]) => {
    const value = path.split(".").reduce((inner, key) => inner?.[key], figures[step]);
    return typeof value === "number" ? [[name, write(value)]] : [];
  });
}
