/** Return the map x' = a x - b y + tx, y' = -b x - a y + ty from a component's metres to pixels. @param {import("./scene.js").Pose} pose @param {import("./scene.js").View} view */
export function toPixels(pose, view) {
  return {
    a: Math.cos(pose.theta) * view.scale,
    b: Math.sin(pose.theta) * view.scale,
    tx: view.width / 2 + (pose.x - view.x) * view.scale,
    ty: view.height / 2 - (pose.y - view.y) * view.scale,
  };
}

/** Points within a pixel of the last one are left out. @param {any} context @param {Float32Array} points @param {{a: number, b: number, tx: number, ty: number}} T */
export function polyline(context, points, { a, b, tx, ty }) {
  let [lastX, lastY] = [Infinity, Infinity];
  for (let i = 0; i < points.length; i += 2) {
    const x = a * points[i] - b * points[i + 1] + tx;
    const y = -b * points[i] - a * points[i + 1] + ty;
    if (i === 0) context.moveTo(x, y);
    else if (i + 2 >= points.length || Math.abs(x - lastX) + Math.abs(y - lastY) >= 1) {
      context.lineTo(x, y);
    } else continue;
    [lastX, lastY] = [x, y];
  }
}
