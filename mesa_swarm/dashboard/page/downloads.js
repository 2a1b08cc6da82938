/* Files that Python sends in pieces, so that none blocks the connection. Put before a widget's module, after
   elements.js. */

/** Save a file for the user. */
function save(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

class ReceivedFiles {
  #model; #files = new Map();

  constructor(model) {
    this.#model = model;
  }

  /** Take a message that belongs to a file; return whether it does. */
  receive(message, buffers) {
    if (message.kind !== "file") return false;
    const { number, name, type, last } = message, pieces = this.#files.get(number) ?? [];
    const bytes = buffers[0];
    pieces.push(new Uint8Array(bytes.buffer ?? bytes, bytes.byteOffset ?? 0, bytes.byteLength).slice());
    this.#files.set(number, pieces);
    if (!last) {
      this.#model.send({ do: "more", value: number });
      return true;
    }
    this.#files.delete(number);
    save(name, new Blob(pieces, { type }));
    return true;
  }
}
