// What a hand does on the page: where it points, what it holds, and the arrow keys.

export const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/** Where a pointer is on `target`: the shares of its width and height, from the upper left. */
export function shares({ clientX, clientY }, target) {
  const box = target.getBoundingClientRect();
  return [(clientX - box.left) / box.width, (clientY - box.top) / box.height];
}

/** Call `move(event)` while a pointer is held on `target` that `take(event)`, when it goes down, does not refuse. */
export function onDrag(target, { take = () => {}, move, end = () => {} }) {
  target.addEventListener("pointerdown", (event) => {
    if (take(event) !== false) target.setPointerCapture(event.pointerId);
  });
  target.addEventListener("pointermove", (event) => target.hasPointerCapture(event.pointerId) && move(event));
  target.addEventListener("lostpointercapture", end);
}

/** Call `act(event)` for keys on `target`, none of them the browser's own; it returns false for one of no use. */
export function onKey(target, act) {
  target.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || act(event) === false) return;
    event.preventDefault();
  });
}
