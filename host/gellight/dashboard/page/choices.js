// What a visitor has chosen: kept in the address, to be sent to others, and in the browser, for the next visit.

const KEY = "gellight.choices";

export class Choices {
  #controls = new Map(); // name: {read(), write(text), first}

  /** Keep the value of `select`; `apply(value)` is called with it now and whenever it changes. */
  select(select, apply) {
    this.#keep(select.id, {
      read: () => select.value,
      write: (value) => {
        if (![...select.options].some((option) => option.value === value)) return;
        select.value = value;
        apply(value);
      },
    });
    select.addEventListener("change", () => {
      apply(select.value);
      this.#save();
    });
  }

  /** Keep whether `details` is open. */
  details(details) {
    this.#keep(details.id, { read: () => (details.open ? "1" : "0"), write: (value) => { details.open = value === "1"; } });
    details.addEventListener("toggle", () => this.#save());
  }

  /** Apply all choices again, to what was not there when they were made. */
  apply() {
    for (const { read, write } of this.#controls.values()) write(read());
  }

  /** Choose again what the page chooses on a first visit. */
  reset() {
    for (const { write, first } of this.#controls.values()) write(first);
    this.#save();
  }

  #keep(name, control) {
    const chosen = fromAddress().get(name) ?? remembered()[name];
    control.first = control.read();
    control.write(chosen ?? control.first);
    this.#controls.set(name, control);
  }

  #save() {
    const values = [...this.#controls].map(([name, { read, first }]) => [name, read(), first]);
    const chosen = Object.fromEntries(values.filter(([, value, first]) => value !== first).map(([name, value]) => [name, value]));
    const text = new URLSearchParams(chosen).toString();
    window.history.replaceState(null, "", text ? `#${text}` : location.pathname);
    try {
      localStorage.setItem(KEY, JSON.stringify(chosen));
    } catch (error) {
      console.info(`the browser keeps no choices: ${error.message}`);
    }
  }
}

function fromAddress() {
  return new URLSearchParams(location.hash.slice(1));
}

function remembered() {
  try {
    return JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch (error) {
    console.info(`the browser remembers no choices: ${error.message}`);
    return {};
  }
}
