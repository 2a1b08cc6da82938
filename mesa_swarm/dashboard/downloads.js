/* Files that Python hands over in pieces, so that none of them fills a connection. Put before a widget's module, after
   elements.js. */

/** Hand a file to the user. */
function save(name, blob) {
  const link = make("a", { href: URL.createObjectURL(blob), download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

class Downloads {
  #model; #files = new Map();

  constructor(model) {
    this.#model = model;
  }

  /** Take a message that belongs to a file; tell whether it did. */
  hear(message, buffers) {
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
