// The one place for what a visitor has to know before anything else, each with what can be done about it.

import { button, node } from "./dom.js";

const ORDER = ["fault", "warning", "notice"];

export class Banners {
  #box;
  #shown = new Map(); // key: {severity, words, box}

  constructor(box) {
    this.#box = box;
  }

  /** Show `text` under `key`, as a fault, warning or notice, with `actions` [[label, act or address], ...]. */
  show(key, severity, text, actions = []) {
    const words = [severity, text, ...actions.map(([label]) => label)].join("\n");
    if (this.#shown.get(key)?.words === words) return;
    this.hide(key);
    const box = node("section", "", `banner ${severity}`, { role: severity === "fault" ? "alert" : "status", testid: `banner-${key}` });
    box.append(node("p", text), ...actions.map(([label, act]) => (typeof act === "string" ? node("a", label, "link", { href: act }) : button(label, act))));
    this.#shown.set(key, { severity, words, box });
    const later = [...this.#shown.values()].find((other) => other.box.isConnected && ORDER.indexOf(other.severity) > ORDER.indexOf(severity));
    if (later) later.box.before(box);
    else this.#box.append(box);
  }

  hide(key) {
    this.#shown.get(key)?.box.remove();
    this.#shown.delete(key);
  }
}
