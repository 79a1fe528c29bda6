"use strict";
// Meshes: converts the program's 16-bit numbers to geometries. Each body has one geometry with colours and one without.

/** Cosine of the largest angle between neighbouring triangles that are shaded as one smooth surface. */
const CREASE = Math.cos((38 * Math.PI) / 180);

/** Decodes base64 text to 16-bit numbers. */
function numbersOf(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Uint16Array(bytes.buffer);
}

/** Returns the pose and scale of a shape as a function of a point (x, y, z), and whether the scale mirrors the shape. */
function placing({ size, position, quaternion }) {
  const q = new THREE.Quaternion().fromArray(quaternion ?? [0, 0, 0, 1]), o = new THREE.Vector3().fromArray(position ?? [0, 0, 0]);
  const point = new THREE.Vector3();
  return { mirrored: size[0] * size[1] * size[2] < 0, place: (x, y, z) => point.set(x * size[0], y * size[1], z * size[2]).applyQuaternion(q).add(o) };
}

/** Returns the corners of the bounding box of a mesh, in the frame of its body. */
function cornersOf(shape, { low, side }) {
  const { place } = placing(shape);
  return [0, 1, 2, 3, 4, 5, 6, 7].map((c) => place(...low.map((x, k) => x + ((c >> k) & 1) * side[k])).clone());
}

/** Returns the meshes among a body's shapes as pairs: whether they have their own colours, and their geometry. */
function meshesOf(shapes, meshes) {
  const found = [];
  for (const coloured of [false, true]) {
    const parts = shapes.filter((shape) => shape.kind === "mesh" && !!shape.color === coloured);
    if (parts.length) found.push([coloured, meshGeometry(parts, meshes, coloured)]);
  }
  return found;
}

/** Merges several parts into one geometry, smooth except at creases. */
function meshGeometry(parts, meshes, coloured) {
  const decoded = parts.map((shape) => ({ shape, points: numbersOf(meshes[shape.part].points), corners: numbersOf(meshes[shape.part].triangles) }));
  const count = decoded.reduce((sum, { corners }) => sum + corners.length, 0);
  const position = new Float32Array(3 * count), normal = new Float32Array(3 * count), colour = coloured ? new Float32Array(3 * count) : null;
  let at = 0;
  for (const { shape, points, corners } of decoded) {
    const { low, side } = meshes[shape.part], { place, mirrored } = placing(shape);
    if (mirrored) for (let t = 0; t < corners.length; t += 3) [corners[t], corners[t + 1]] = [corners[t + 1], corners[t]];
    const placed = new Float32Array(points.length);
    for (let i = 0; i < points.length; i += 3) place(low[0] + (side[0] * points[i]) / 65535, low[1] + (side[1] * points[i + 1]) / 65535, low[2] + (side[2] * points[i + 2]) / 65535).toArray(placed, i);
    const shades = normalsOf(placed, corners);
    const tint = coloured ? new THREE.Color(shape.color) : null;
    for (let c = 0; c < corners.length; c++, at += 3) {
      for (let k = 0; k < 3; k++) {
        position[at + k] = placed[3 * corners[c] + k];
        normal[at + k] = shades[3 * c + k];
      }
      if (tint) tint.toArray(colour, at);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(position, 3));
  geometry.setAttribute("normal", new THREE.Float32BufferAttribute(normal, 3));
  if (colour) geometry.setAttribute("color", new THREE.Float32BufferAttribute(colour, 3));
  return geometry;
}

/** Returns the normal at each corner: the area-weighted mean over triangles at its point whose normals are close to its own. */
function normalsOf(points, corners) {
  const count = corners.length / 3, faces = new Float32Array(corners.length), areas = new Float32Array(count);
  const first = new Int32Array(points.length / 3 + 1);
  for (let t = 0; t < count; t++) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * corners[3 * t + k]);
    const [ux, uy, uz, vx, vy, vz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2], points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
    const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    areas[t] = Math.hypot(x, y, z);
    const by = areas[t] > 0 ? 1 / areas[t] : 0;
    faces.set([x * by, y * by, z * by], 3 * t);
    for (let k = 0; k < 3; k++) first[corners[3 * t + k] + 1]++;
  }
  for (let p = 1; p < first.length; p++) first[p] += first[p - 1];
  const around = new Int32Array(corners.length), fill = first.slice();
  for (let c = 0; c < corners.length; c++) around[fill[corners[c]]++] = (c / 3) | 0;
  const normals = new Float32Array(3 * corners.length);
  for (let c = 0; c < corners.length; c++) {
    const own = 3 * ((c / 3) | 0);
    let x = 0, y = 0, z = 0;
    for (let i = first[corners[c]]; i < first[corners[c] + 1]; i++) {
      const t = 3 * around[i];
      if (faces[own] * faces[t] + faces[own + 1] * faces[t + 1] + faces[own + 2] * faces[t + 2] < CREASE) continue;
      const area = areas[around[i]];
      x += area * faces[t]; y += area * faces[t + 1]; z += area * faces[t + 2];
    }
    const length = Math.hypot(x, y, z);
    normals.set(length > 0 ? [x / length, y / length, z / length] : [0, 0, 1], 3 * c);
  }
  return normals;
}
