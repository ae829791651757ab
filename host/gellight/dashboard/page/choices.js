// What a visitor has chosen: kept in the address, to be sent to others, and in the browser, for the next visit.

const KEY = "gellight.choices";

export class Choices {
  #controls = new Map(); // a select or details element: {apply(value), first}

  /** Keep a control's value, of a details element whether it is open; `apply(value)` is called now and on changes. */
  keep(control, apply = () => {}) {
    const first = read(control);
    this.#controls.set(control, { apply, first });
    const inAddress = new URLSearchParams(location.hash.slice(1)).get(control.id);
    this.#write(control, inAddress ?? remembered()[control.id] ?? first);
    control.addEventListener(isFold(control) ? "toggle" : "change", () => {
      apply(read(control));
      this.#save();
    });
  }

  /** Choose again what the page chooses on a first visit. */
  reset() {
    for (const [control, { first }] of this.#controls) this.#write(control, first);
    this.#save();
  }

  #write(control, value) {
    if (isFold(control)) control.open = value === "1";
    else if ([...control.options].some((option) => option.value === value)) control.value = value;
    this.#controls.get(control).apply(read(control));
  }

  #save() {
    const others = [...this.#controls].filter(([control, { first }]) => read(control) !== first);
    const chosen = Object.fromEntries(others.map(([control]) => [control.id, read(control)]));
    const text = new URLSearchParams(chosen).toString();
    window.history.replaceState(null, "", text ? `#${text}` : location.pathname);
    try {
      localStorage.setItem(KEY, JSON.stringify(chosen));
    } catch (error) {
      console.info(`the browser keeps no choices: ${error.message}`);
    }
  }
}

const isFold = (control) => control.matches("details");
const read = (control) => (isFold(control) ? String(Number(control.open)) : control.value);

function remembered() {
  try {
    return JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch (error) {
    console.info(`the browser remembers no choices: ${error.message}`);
    return {};
  }
}
