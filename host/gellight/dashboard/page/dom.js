// Elements of the page: found, written, made.

export const element = (id) => document.getElementById(id);

/** Write `text`, if it is another one: the page is laid out anew after every change. */
export function write(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}

/** Return a new element; `more`: its other properties, and `testid`. */
export function node(kind, textContent, className = "", { testid, ...more } = {}) {
  const made = Object.assign(document.createElement(kind), { textContent, className }, more);
  if (testid) made.dataset.testid = testid;
  return made;
}

/** Return a button that calls `act`. */
export function button(text, act, className = "", more = {}) {
  return node("button", text, className, { ...more, onclick: act });
}

export function row(...cells) {
  const line = node("tr", "");
  line.append(...cells);
  return line;
}

/** Return an element of SVG with its attributes and children. */
export function shape(kind, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}
