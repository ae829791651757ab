// From a message to a view that can be drawn.

import { slopesOf } from "./derived.js";
import { sizeMm } from "./field.js";
import { decode } from "./message.js";

/** Return a promise of the view of a message, with its camera image (`bitmap`) and its slopes. */
export async function decodeView(buffer) {
  const view = decode(buffer);
  const [width, height] = sizeMm(view.header);
  view.slopes = slopesOf(view.depth, view.width, view.height, [width / view.width, height / view.height]);
  view.bitmap = await createImageBitmap(new Blob([view.image], { type: "image/jpeg" }));
  return view;
}
