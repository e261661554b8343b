// A model's WebAssembly out of the page, with the library that its C calls.

import { libc } from "./libc.js";

// The exports of a module that is packed in letters; `said()` gives what it has said since it was last asked.
export async function load(letters) {
  const packed = Uint8Array.from(atob(letters), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = await new Response(stream).arrayBuffer();
  const decoder = new TextDecoder();
  let text = "";

  const memory = () => instance.exports.memory;
  const env = libc(memory, (words) => (text += decoder.decode(words)) && words.length);
  const { instance } = await WebAssembly.instantiate(bytes, { env });
  function said() {
    const told = text;
    text = "";
    return told;
  }
  return { exports: { ...instance.exports, malloc: env.malloc }, said };
}
