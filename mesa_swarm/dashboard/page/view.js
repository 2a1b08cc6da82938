/* What the views of the page share. Put before a widget's module, after elements.js. */

/** Show a text, or nothing where it is empty; text that is set anew would be read out again. */
function showText(element, text) {
  if (element.textContent !== text) element.textContent = text;
  element.hidden = !text;
}

/** Save a file for the user. */
function save(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** Return the bytes of a message's buffer, copied, since the buffer is used again. */
const bytesOf = (buffer) => new Uint8Array(buffer.buffer ?? buffer, buffer.byteOffset ?? 0, buffer.byteLength).slice();

/** Round numbers that divide a range into about this number of parts, and their distance. */
function roundNumbers(low, high, parts) {
  const rough = (high - low) / parts || 1, power = 10 ** Math.floor(Math.log10(rough)), numbers = [];
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((width) => width >= rough * 0.999);
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + step * 1e-9; k++) numbers.push(k * step + 0);
  return [numbers, step];
}

/** Return a canvas's context for drawing in CSS pixels, as sharp as the screen is. */
function sizedContext(canvas, width, height) {
  const ratio = (devicePixelRatio || 1) * (canvas.currentCSSZoom ?? 1), context = canvas.getContext("2d");
  canvas.width = Math.round(width * ratio);
  canvas.height = Math.round(height * ratio);
  context.scale(ratio, ratio);
  return context;
}

/** What shows a widget's model in an element of the page, until it is destroyed. */
class View {
  #leave = []; #files = new Map();

  constructor(model, root, name) {
    Object.assign(this, { model, root });
    if (name) root.classList.add(name);
  }

  destroy() { this.#leave.forEach((leave) => leave()); }

  /** Do this at the end. */
  atEnd(leave) { this.#leave.push(leave); }

  /** Act on what the model or a part of the page notifies of, until the end. */
  listen(target, name, act) {
    const [begin, end] = target === this.model ? ["on", "off"] : ["addEventListener", "removeEventListener"];
    target[begin](name, act);
    this.atEnd(() => target[end](name, act));
  }

  /** Show traits of the model, each by its function: now, and whenever it changes. */
  follow(acts) {
    for (const [name, act] of Object.entries(acts)) this.listen(this.model, `change:${name}`, () => act());
    for (const act of Object.values(acts)) act();
  }

  send(message, buffers) { this.model.send(message, undefined, buffers); }

  /** Save the files that Python sends, and act on its other messages. */
  receive(act = () => {}) {
    const take = (message, buffers) => (message.kind === "file" ? this.#takePiece(message, buffers[0]) : act(message, buffers));
    this.listen(this.model, "msg:custom", take);
  }

  /** Files come in pieces, so that none blocks the connection. */
  #takePiece({ number, name, type, last }, buffer) {
    const pieces = [...(this.#files.get(number) ?? []), bytesOf(buffer)];
    this.#files.set(number, pieces);
    if (!last) return this.send({ do: "more", value: number });
    this.#files.delete(number);
    return save(name, new Blob(pieces, { type }));
  }
}

/** Return the module of a widget that is shown by such a view. */
const shownBy = (Shown) => ({
  render({ model, el }) {
    const view = new Shown(model, el);
    return () => view.destroy();
  },
});
