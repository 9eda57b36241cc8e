/**
 * The map's place in the building's floor plan, and where the two differ.
 *
 * @typedef {import("./contract.js").FloorPlanAnswer} FloorPlanAnswer
 * @typedef {import("./contract.js").PlanDifferencesAnswer} PlanDifferencesAnswer
 */
export class FloorPlan {
  /** @param {import("./api.js").Api} api @param {string} path of the site */
  constructor(api, path) {
    this._api = api;
    this._path = `${path}/floorplan`;
  }

  /** Return where each component lies. Raises ProblemError (404) where there is no plan. @returns {Promise<FloorPlanAnswer>} */
  places() {
    return this._api.get(this._path);
  }

  /** Return the differences of all components that have a place. @param {FloorPlanAnswer} plan */
  async differences(plan) {
    const placed = plan.components.filter((place) => place.T_plan_map !== null);
    /** @type {PlanDifferencesAnswer[]} */
    const answers = await Promise.all(
      placed.map(({ component }) =>
        this._api.get(`${this._path}/differences?component=${encodeURIComponent(component)}`),
      ),
    );
    return {
      missing: answers.flatMap((answer) => answer.missing),
      new: answers.flatMap((answer) => answer.new),
    };
  }
}
