/**
 * Return as much of an id as people need to tell it from others: `c-4hqx` of `c-4hqxw2oklm3dv7ye`.
 *
 * @param {string} id
 */
export function brief(id) {
  return /^[a-z]-[a-z2-7]{16}$/.test(id) ? id.slice(0, 6) : id;
}
