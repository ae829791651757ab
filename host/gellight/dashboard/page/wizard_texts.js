// The words of the wizard: names of steps, actions and pictures, and what is said where a virtual hand presses.

export const STEP_NAMES = { prepare: "Prepare", reference: "Reference", pixel_size: "Pixel size", presses: "Ball presses", fit: "Fit", verify: "Verify" };
export const ACTION_NAMES = { start: "Start", next: "Next", correct: "Correct", drop: "Drop this press", accept: "Accept", abort: "Stop" };
export const PICTURE_NAMES = { live: "Live", press: "Last press", difference: "Last press, difference", cylinder: "Cylinder", verify: "Depth of the check", untouched: "Untouched gel" };

const BY_HAND = "You need a ball and a flat-ended cylinder of known size, and a quarter of an hour. Let the sensor warm up, and clean the gel.";
const BY_VIRTUAL_HAND = "The sensor is simulated: a virtual hand presses everything. You need nothing but some minutes.";
const HAND_DOES = {
  pixel_size: "The virtual hand presses the cylinder, each time at another place.",
  presses: "The virtual hand presses the ball, from a light touch to 2 mm deep, all over the view.",
  verify: "The virtual hand presses the ball at fresh places: these presses judge the calibration and are not learnt from.",
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

/** How pictures are prepared already, which a new calibration keeps. */
export function pictureNote(picture) {
  return picture ? `Of each picture ${picture}; the calibration keeps that.` : "";
}
