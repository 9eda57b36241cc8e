import { h } from "./dom.js";

/** Save an answer's body as a file: a link could not carry the token. @param {Response} response @param {string} name */
export async function saveFile(response, name) {
  const url = URL.createObjectURL(await response.blob());
  h("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
