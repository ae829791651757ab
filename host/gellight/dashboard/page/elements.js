// Elements of tables and lists.

export function row(...cells) {
  const line = document.createElement("tr");
  line.append(...cells);
  return line;
}

export function node(kind, text, className = "") {
  return Object.assign(document.createElement(kind), { textContent: text, className });
}
