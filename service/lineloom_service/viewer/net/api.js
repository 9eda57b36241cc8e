/** The service refused: what it said (RFC 9457 problem details) and with which status. */
export class ProblemError extends Error {
  /** @param {number} status @param {{title?: string, detail?: string, type?: string}} problem */
  constructor(status, problem) {
    super(problem.detail || problem.title || `the service answered ${status}`);
    this.status = status;
    this.type = problem.type ?? "";
  }
}

/** The service did not answer at all. */
export class UnreachableError extends Error {
  constructor() {
    super("the service does not answer");
  }
}

/** Speaks HTTP to the service that served this page. */
export class Api {
  /**
   * @param {import("./token.js").Token} token
   * @param {string} [base] address of the service, with a slash at its end
   */
  constructor(token, base = document.baseURI) {
    this.token = token;
    this.base = base;
    /** @type {Map<string, {etag: string, value: any}>} */
    this._copies = new Map();
  }

  /**
   * GET JSON. An answer with an ETag is kept, asked for conditionally and returned again, the very
   * same object, for as long as it holds.
   *
   * @param {string} path @returns {Promise<any>}
   */
  async get(path) {
    const copy = this._copies.get(path);
    const response = await this.open(path, copy ? { "If-None-Match": copy.etag } : {});
    if (response.status === 304 && copy) {
      await response.body?.cancel();
      return copy.value;
    }
    const value = await response.json();
    const etag = response.headers.get("ETag");
    if (etag) this._copies.set(path, { etag, value });
    else this._copies.delete(path);
    return value;
  }

  /** POST JSON. @param {string} path @param {any} [body] @returns {Promise<any>} */
  async post(path, body) {
    const response = await this._fetch(path, {
      method: "POST",
      headers: body === undefined ? {} : { "Content-Type": "application/json" },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
    return response.status === 204 ? null : response.json();
  }

  /**
   * GET, and leave the body to the caller.
   *
   * @param {string} path @param {Record<string, string>} [headers] @param {AbortSignal} [signal]
   */
  open(path, headers = {}, signal) {
    return this._fetch(path, { headers, signal });
  }

  /** Forget kept answers. */
  forget() {
    this._copies.clear();
  }

  /** @param {string} path @param {RequestInit & {headers: Record<string, string>}} options */
  async _fetch(path, options) {
    const headers = { ...options.headers };
    if (this.token.value) headers.Authorization = `Bearer ${this.token.value}`;
    let response;
    try {
      response = await fetch(new URL(path, this.base), {
        ...options,
        headers,
        cache: "no-store",
        credentials: "same-origin",
      });
    } catch (error) {
      if (error instanceof DOMException && error.name === "AbortError") throw error;
      throw new UnreachableError();
    }
    if (response.ok || response.status === 304) return response;
    // A gateway in between answers for a service that is away.
    if ([502, 503, 504].includes(response.status)) throw new UnreachableError();
    throw new ProblemError(response.status, await response.json().catch(() => ({})));
  }
}
