/**
 * What changed in a table of entries with ids, as the service tells it: which are new or not what
 * they were, as they are now, and the ids of those that are gone.
 *
 * @template {{id: string}} Entry
 */
export class TableChange {
  /** @param {Entry[]} entries @param {string[]} gone */
  constructor(entries, gone) {
    this.entries = entries;
    this.gone = gone;
  }

  /**
   * Bring a table up to date, and return what was in it of the entries that changed or went.
   *
   * @param {Map<string, Entry>} table by id
   * @returns {Map<string, Entry>}
   */
  apply(table) {
    /** @type {Map<string, Entry>} */
    const out = new Map();
    for (const id of [...this.gone, ...this.entries.map((entry) => entry.id)]) {
      const was = table.get(id);
      if (was) out.set(id, was);
    }
    for (const id of this.gone) table.delete(id);
    for (const entry of this.entries) table.set(entry.id, entry);
    return out;
  }

  /** Return the entries that a table does not have. @param {Map<string, Entry>} table */
  cameTo(table) {
    return this.entries.filter(({ id }) => !table.has(id));
  }
}
