// Measures of a page; each returns what is wrong, as a list.

(() => {
const name = (e) => [e.tagName.toLowerCase(), e.id || e.className || "", e.textContent.trim().slice(0, 30)].join(" ");
const seen = (css) => [...document.querySelectorAll(css)].filter((e) => e.checkVisibility({ visibilityProperty: true })
    && e.getBoundingClientRect().width > 0);
const pen = Object.assign(document.createElement("canvas"), { width: 1, height: 1 }).getContext("2d", { willReadFrequently: true });
const rgba = (css) => {
    pen.clearRect(0, 0, 1, 1);
    pen.fillStyle = css;
    pen.fillRect(0, 0, 1, 1);
    return [...pen.getImageData(0, 0, 1, 1).data];
};
const over = ([r, g, b, a], ground) => [r, g, b].map((c, i) => (c * a + ground[i] * (255 - a)) / 255);
const ground = (e) => {
    if (!e) return [255, 255, 255];
    const own = rgba(getComputedStyle(e).backgroundColor);
    return own[3] === 255 ? own.slice(0, 3) : over(own, ground(e.parentElement));
};
const light = (rgb) => rgb.map((c) => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
const contrast = (a, b) => { const [x, y] = [light(a), light(b)]; return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05); };
const texts = () => seen("body *").filter((e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()))
    .filter((e) => !e.closest(":disabled, .marks, option"));

window.measures = {
  /** Pairs of neighbours that lie over each other. */
  overlaps() {
      const box = (e) => {
          const range = document.createRange(); // a heading's words, not its whole line
          range.selectNodeContents(e);
          return (["H2", "H3", "P"].includes(e.tagName) ? range : e).getBoundingClientRect();
      };
      const beside = (a, b) => a.right <= b.left + 1 || b.right <= a.left + 1;
      const apart = (a, b) => beside(a, b) || a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
      const groups = ["main > *:not(aside), aside > *", "body > *:not(.help)", "header > *", ".banners > *", ".banner > *",
          ".toolbar > *", ".panel > *", ".head > *", ".controls > *", ".contact-row > *", ".buttons > *", ".objects > *",
          "th, .contacts td", "#checks td", ".drawer > *", ".pairs div > *", ".bars div > *", ".steps > *", ".actions > *", ".needs li > *", ".progress > *", ".request > *", ".identity > *"];
      const wrong = [];
      for (const css of groups) {
          const all = seen(css);
          all.forEach((e, i) => {
              for (const f of all.slice(i + 1)) if (!e.contains(f) && !apart(box(e), box(f))) wrong.push([name(e), name(f)]);
          });
      }
      return wrong;
  },

  /** Text that does not fit into its element; the names in the header may be shortened, their title says them whole. */
  cut() {
      const texts = seen("button, a, th, td, dd, dt, h1, h2, h3, p, label, li, output, select, summary, .pill, .marks span");
      return texts.filter((e) => e.clientWidth > 0 && !["sensor", "bundle"].includes(e.id)
          && (e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 3)).map(name);
  },

  /** What lies outside the window's width, outside its panel, or where no scrolling reaches. */
  beyond() {
      const wrong = seen("body *:not(svg *)").filter((e) => {
          const { left, right } = e.getBoundingClientRect();
          return left < -1 || right > document.documentElement.clientWidth + 1;
      }).map((e) => "beyond the window: " + name(e));
      if (document.documentElement.scrollWidth > document.documentElement.clientWidth) wrong.push("the page scrolls sideways");
      for (const panel of seen(".panel")) {
          const outer = panel.getBoundingClientRect();
          for (const e of panel.querySelectorAll("*")) {
              if (e.closest(".contacts tbody, .marks, .stagebox canvas, svg *") || !e.checkVisibility()) continue;
              const { left, top, right, bottom } = e.getBoundingClientRect();
              const out = left < outer.left - 1 || top < outer.top - 1 || right > outer.right + 1 || bottom > outer.bottom + 1;
              if (out && right > left) wrong.push(name(e) + " out of " + name(panel));
          }
      }
      const reach = document.documentElement.scrollHeight;
      wrong.push(...seen(".panel").filter((e) => e.getBoundingClientRect().bottom + scrollY > reach + 1)
          .map((e) => "cannot be scrolled to: " + name(e)));
      return wrong;
  },

  /** Text with too little contrast to what lies behind it. */
  weakText() {
      return texts().map((e) => [name(e), contrast(over(rgba(getComputedStyle(e).color), ground(e)), ground(e))])
          .filter(([, ratio]) => ratio < 4.5);
  },

  /** Controls whose edge can hardly be told from what lies around them. */
  weakEdges() {
      return seen("button, select, a.link").filter((e) => !e.matches(":disabled"))
          .map((e) => [name(e), contrast(rgba(getComputedStyle(e).borderTopColor).slice(0, 3), ground(e.parentElement))])
          .filter(([, ratio]) => ratio < 3);
  },

  /** Text under 12 px. */
  smallText() {
      const scale = (e) => (e instanceof SVGElement ? e.getScreenCTM().a : 1);
      return texts().map((e) => [name(e), parseFloat(getComputedStyle(e).fontSize) * scale(e)]).filter(([, px]) => px < 12);
  },
};
})();
