// A model's WebAssembly out of the page, and the three calls by which C speaks on standard error.

const STDERR_CALLS = "wasi_snapshot_preview1";

// The exports of a module that is packed in letters; `said()` gives what it has said since it was last asked.
export async function load(letters) {
  const packed = Uint8Array.from(atob(letters), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = await new Response(stream).arrayBuffer();
  const decoder = new TextDecoder();
  let text = "";

  function fd_write(file, pieces, count, written) {
    const memory = new DataView(exports.memory.buffer);
    let total = 0;
    for (let i = 0; i < count; i++) {
      const start = memory.getUint32(pieces + 8 * i, true);
      const length = memory.getUint32(pieces + 8 * i + 4, true);
      text += decoder.decode(new Uint8Array(exports.memory.buffer, start, length), { stream: true });
      total += length;
    }
    memory.setUint32(written, total, true);
    return 0;
  }

  const calls = { fd_write, fd_close: () => 0, fd_seek: () => 0 };
  const { instance } = await WebAssembly.instantiate(bytes, { [STDERR_CALLS]: calls });
  const exports = instance.exports;
  exports._initialize();
  function said() {
    const told = text;
    text = "";
    return told;
  }
  return { exports, said };
}
