// The one place for what a visitor has to know before anything else, each with what can be done about it.

const ORDER = ["fault", "warning", "notice"];

export class Banners {
  #box;
  #shown = new Map(); // key: {severity, words, node}

  constructor(box) {
    this.#box = box;
  }

  /** Show `text` under `key`, as a fault, warning or notice, with `actions` [[label, act or address], ...]. */
  show(key, severity, text, actions = []) {
    const words = [severity, text, ...actions.map(([label]) => label)].join("\n");
    if (this.#shown.get(key)?.words === words) return;
    this.hide(key);
    const node = Object.assign(document.createElement("section"), { className: `banner ${severity}` });
    node.dataset.testid = `banner-${key}`;
    node.setAttribute("role", severity === "fault" ? "alert" : "status");
    node.append(Object.assign(document.createElement("p"), { textContent: text }), ...actions.map(button));
    this.#shown.set(key, { severity, words, node });
    const later = [...this.#shown.values()].find((other) => other.node.isConnected && ORDER.indexOf(other.severity) > ORDER.indexOf(severity));
    if (later) later.node.before(node);
    else this.#box.append(node);
  }

  hide(key) {
    this.#shown.get(key)?.node.remove();
    this.#shown.delete(key);
  }
}

function button([label, act]) {
  if (typeof act === "string") return Object.assign(document.createElement("a"), { textContent: label, href: act, className: "link" });
  const made = Object.assign(document.createElement("button"), { textContent: label });
  made.addEventListener("click", act);
  return made;
}
