"use strict";
// 3-D playback. The world frame is the frame of the data: lengths in metres, z up.

/** Draws `data.scene` into `host`. Returns the functions that the player calls. Throws if the browser has no WebGL. */
function makeScene(data, host) {
  const { bodies, poses, trail, follow } = data.scene;
  const renderer = new THREE.WebGLRenderer({ antialias: true });
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFShadowMap;
  const canvas = renderer.domElement;
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${data.robot} in motion. Drag to rotate, right button to move, wheel to zoom. Keyboard: Shift and arrow keys rotate, plus and minus zoom.`);
  host.prepend(canvas);

  const scene = new THREE.Scene();
  scene.fog = new THREE.Fog(0, 1, 10);
  const camera = new THREE.PerspectiveCamera(32, 1, 0.01, 100);
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.maxPolarAngle = Math.PI * 0.62;

  // --- extent of the whole motion: determines the sizes of camera, light, floor and markers, for grippers and humanoids alike
  const { cloud, lowest } = cloudOf(data);
  const box = new THREE.Box3().setFromPoints(cloud);
  const centre = box.getCenter(new THREE.Vector3());
  const size = Math.max(box.getSize(new THREE.Vector3()).length(), 1e-3);
  // A robot on the ground stands on z = 0. If a robot moves below z = 0, the floor is lowered so that it does not hide the robot.
  const floorZ = lowest < -0.05 * size ? lowest - 0.04 * size : 0;
  controls.minDistance = 0.2 * size;
  controls.maxDistance = 8 * size;
  camera.near = 0.02 * size;
  camera.far = 30 * size;

  // --- light: a soft environment, and one lamp that casts shadows
  const environment = new THREE.PMREMGenerator(renderer);
  scene.environment = environment.fromScene(new THREE.RoomEnvironment(), 0.04).texture;
  scene.environmentRotation.x = Math.PI / 2; // the environment has y up
  environment.dispose();
  const lamp = new THREE.DirectionalLight(0xffffff, 1.3);
  lamp.position.copy(centre).add(new THREE.Vector3(0.5, -0.45, 1.3).multiplyScalar(size));
  lamp.target.position.copy(centre);
  lamp.castShadow = true;
  lamp.shadow.mapSize.set(2048, 2048);
  lamp.shadow.radius = 5;
  lamp.shadow.normalBias = 0.004 * size;
  Object.assign(lamp.shadow.camera, { left: -size, right: size, top: size, bottom: -size, near: 0.05 * size, far: 4 * size });
  scene.add(lamp, lamp.target);

  // --- floor: a grid that fades into the background, and the robot's shadow; the grid width depends on the robot's size
  const pitch = 10 ** Math.round(Math.log10(size / 8));
  const grid = new THREE.LineSegments(gridGeometry(pitch, 60), new THREE.LineBasicMaterial());
  grid.position.set(Math.round(centre.x / pitch) * pitch, Math.round(centre.y / pitch) * pitch, floorZ - 0.002 * size);
  const ground = new THREE.Mesh(new THREE.PlaneGeometry(20 * size, 20 * size), new THREE.ShadowMaterial());
  ground.position.set(centre.x, centre.y, floorZ - 0.001 * size);
  ground.receiveShadow = true;
  scene.add(grid, ground);

  // --- the robot: one group per body, posed at every frame
  const themed = []; // [material, name of its colour in the style sheet]
  const paint = (kind) => {
    const material = new THREE.MeshStandardMaterial({ roughness: 0.5, metalness: 0.05 });
    themed.push([material, kind === "sphere" ? "--ball" : "--bone"]);
    return material;
  };
  const materials = {}; // one per colour, not one per shape
  const groups = bodies.map((body) => {
    const group = new THREE.Group();
    for (const shape of body.shapes) {
      const geometry = shape.kind === "mesh" ? null : geometryOf(shape);
      if (!geometry) continue;
      const material = materials[shape.color ?? shape.kind] ??= shape.color
        ? new THREE.MeshStandardMaterial({ color: shape.color, roughness: 0.5, metalness: 0.05 })
        : paint(shape.kind);
      const mesh = new THREE.Mesh(geometry, material);
      if (shape.position) mesh.position.fromArray(shape.position);
      if (shape.quaternion) mesh.quaternion.fromArray(shape.quaternion);
      group.add(mesh);
    }
    for (const [coloured, geometry] of meshesOf(body.shapes, data.scene.meshes)) {
      const material = materials[`mesh ${coloured}`] ??= coloured
        ? new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.55, metalness: 0.05 })
        : paint("mesh");
      material.side = 2; // both sides, because some files have triangles with the wrong orientation
      group.add(new THREE.Mesh(geometry, material));
    }
    for (const mesh of group.children) mesh.castShadow = mesh.receiveShadow = true;
    scene.add(group);
    return group;
  });

  // --- collision shapes: translucent and hidden at first, so that the robot stays visible inside
  const solids = (data.scene.collisions ?? []).map((shape) => {
    const material = materials.collision ??= new THREE.MeshStandardMaterial({ roughness: 0.8, transparent: true, opacity: 0.4, depthWrite: false });
    const mesh = new THREE.Mesh(geometryOf(shape), material);
    mesh.position.fromArray(shape.position);
    mesh.quaternion.fromArray(shape.quaternion);
    if (shape.kind === "ellipsoid") mesh.scale.fromArray(shape.size);
    mesh.visible = false;
    groups[shape.body].add(mesh);
    return mesh;
  });
  if (materials.collision) themed.push([materials.collision, "--target"]);

  // --- path of the end-effector: the whole path faint, the travelled part strong
  const tip = new THREE.Mesh(new THREE.SphereGeometry(0.009 * size, 24, 16), new THREE.MeshBasicMaterial());
  let travelled = null;
  if (trail && trail.length > 1) {
    const flat = trail.flat();
    const path = (opacity) => {
      const geometry = new THREE.LineGeometry().setPositions(flat);
      const material = new THREE.LineMaterial({ linewidth: 3, transparent: opacity < 1, opacity });
      themed.push([material, "--accent"]);
      const line = new THREE.Line2(geometry, material);
      scene.add(line);
      return geometry;
    };
    path(0.3);
    travelled = path(1);
    themed.push([tip.material, "--accent"]);
    scene.add(tip);
  }

  // --- feet: the path of each foot, and an arrow for its contact force; an arrow as long as a third of the scene is
  // the robot's weight
  const contacts = data.contacts;
  const arrows = (contacts?.trails ?? []).map((way) => {
    const geometry = new THREE.LineGeometry().setPositions(way.flat());
    const line = new THREE.LineMaterial({ linewidth: 2, transparent: true, opacity: 0.55 });
    themed.push([line, "--accent"]);
    if (way.length > 1) scene.add(new THREE.Line2(geometry, line));
    // visible through the robot, because a leg covers the point where the force acts
    const material = new THREE.MeshStandardMaterial({ roughness: 0.6, depthTest: false, transparent: true, opacity: 0.9 });
    themed.push([material, "--force"]);
    const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.006 * size, 0.006 * size, 1, 16).translate(0, 0.5, 0), material);
    const head = new THREE.Mesh(new THREE.CylinderGeometry(0, 0.016 * size, 0.045 * size, 20), material);
    shaft.renderOrder = head.renderOrder = 5;
    const arrow = new THREE.Group();
    arrow.add(shaft, head);
    scene.add(arrow);
    return { arrow, shaft, head };
  });
  const upwards = new THREE.Vector3(0, 1, 0), foot = new THREE.Vector3(), force = new THREE.Vector3();
  function showForces(k, s) {
    arrows.forEach(({ arrow, shaft, head }, f) => {
      const newtons = contacts.forces[Math.min(k, contacts.forces.length - 1)]?.[f];
      arrow.visible = !!newtons;
      if (!newtons) return;
      const way = contacts.trails[f];
      foot.fromArray(way[k]).lerp(force.fromArray(way[Math.min(k + 1, way.length - 1)]), s);
      const long = (0.33 * size * force.fromArray(newtons).length()) / contacts.weight;
      arrow.visible = long > 0.005 * size;
      arrow.position.copy(foot);
      arrow.quaternion.setFromUnitVectors(upwards, force.normalize());
      shaft.scale.y = Math.max(long - 0.0225 * size, 1e-6);
      head.position.y = long;
    });
  }

  // --- target: a dot in three rings, visible from every side
  if (data.target) {
    const material = new THREE.MeshBasicMaterial();
    themed.push([material, "--target"]);
    const mark = new THREE.Group();
    mark.add(new THREE.Mesh(new THREE.SphereGeometry(0.007 * size, 24, 16), material));
    const ring = new THREE.TorusGeometry(0.024 * size, 0.0016 * size, 8, 48);
    for (const [x, y] of [[0, 0], [Math.PI / 2, 0], [0, Math.PI / 2]]) {
      const mesh = new THREE.Mesh(ring, material);
      mesh.rotation.set(x, y, 0);
      mark.add(mesh);
    }
    mark.position.fromArray(data.target);
    scene.add(mark);
  }

  // --- drawing, only after a change
  let asked = false;
  function redraw() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(draw);
  }
  function draw() {
    asked = false;
    const distance = camera.position.distanceTo(controls.target);
    scene.fog.near = distance + 0.3 * size;
    scene.fog.far = distance + 2.6 * size;
    renderer.render(scene, camera);
  }

  const q0 = new THREE.Quaternion(), q1 = new THREE.Quaternion(), p1 = new THREE.Vector3();
  /** Poses the robot between knot k and the next one, at the fraction s of the interval. */
  function show(k, s) {
    const next = Math.min(k + 1, poses.length - 1);
    groups.forEach((group, b) => {
      const from = poses[k][b], to = poses[next][b];
      group.position.fromArray(from).lerp(p1.fromArray(to), s);
      group.quaternion.slerpQuaternions(q0.fromArray(from, 3), q1.fromArray(to, 3), s);
    });
    if (travelled) {
      tip.position.fromArray(trail[k]).lerp(p1.fromArray(trail[Math.min(k + 1, trail.length - 1)]), s);
      travelled.instanceCount = k; // number of segments
    }
    showForces(k, s);
    if (follow != null) accompany(groups[follow].position);
    redraw();
  }

  // The camera, the lamp and the floor follow a body that travels far. The lines of the grid stay in their places.
  const start = follow == null ? null : new THREE.Vector3().fromArray(poses[0][follow]), by = new THREE.Vector3();
  const travelledBy = new THREE.Vector3();
  function accompany(position) {
    by.copy(position).sub(start).setZ(0).sub(travelledBy);
    travelledBy.add(by);
    for (const point of [camera.position, controls.target, lamp.position, lamp.target.position, ground.position, centre]) point.add(by);
    for (const point of cloud) point.add(by);
    grid.position.x = Math.round(centre.x / pitch) * pitch;
    grid.position.y = Math.round(centre.y / pitch) * pitch;
    controls.update();
  }

  /** Shows the whole motion from the front right, as close as possible. */
  function reset() {
    moved = false;
    const back = new THREE.Vector3(1, -1.15, 0.62).normalize(); // from the robot to the camera
    const right = new THREE.Vector3(0, 0, 1).cross(back).normalize();
    const up = back.clone().cross(right);
    const tanV = Math.tan((camera.fov * Math.PI) / 360), tanH = tanV * camera.aspect;
    let distance = 0;
    for (const point of cloud) {
      const d = point.clone().sub(centre);
      distance = Math.max(distance, d.dot(back) + Math.max(Math.abs(d.dot(right)) / tanH, Math.abs(d.dot(up)) / tanV));
    }
    controls.target.copy(centre);
    camera.position.copy(centre).addScaledVector(back, 1.12 * distance);
    controls.update();
    redraw();
  }

  // The page must stay scrollable by wheel and finger. The wheel zooms only after a click on the view. One finger rotates
  // the view sideways, two fingers move and zoom it.
  canvas.style.touchAction = "pan-y";
  canvas.addEventListener("wheel", (event) => { if (document.activeElement !== canvas) event.stopImmediatePropagation(); }, { capture: true });

  let moved = false; // whether the user changed the view; resizing the window then keeps it
  controls.addEventListener("start", () => { moved = true; });
  controls.addEventListener("change", redraw);
  canvas.addEventListener("keydown", (event) => {
    const turn = event.shiftKey && { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const zoom = { "+": 0.9, "=": 0.9, "-": 1 / 0.9 }[event.key];
    if (!turn && !zoom) return;
    event.preventDefault();
    moved = true;
    const arm = camera.position.clone().sub(controls.target).multiplyScalar(zoom || 1);
    if (turn) {
      arm.applyAxisAngle(camera.up, 0.1 * turn[0]);
      const polar = arm.angleTo(camera.up), side = camera.up.clone().cross(arm).normalize();
      arm.applyAxisAngle(side, Math.min(Math.max(polar + 0.1 * turn[1], 0.05), controls.maxPolarAngle) - polar);
    }
    camera.position.copy(controls.target).add(arm);
    controls.update();
  });

  /** Shows or hides the collision shapes. */
  function showSolids(yes) {
    for (const solid of solids) solid.visible = yes;
    redraw();
  }

  /** Applies the colours of the style sheet, light or dark. */
  function recolour() {
    scene.background = scene.fog.color = new THREE.Color(css("--sky"));
    grid.material.color.set(css("--floor"));
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    ground.material.opacity = dark ? 0.4 : 0.16;
    scene.environmentIntensity = dark ? 0.4 : 0.55;
    for (const [material, name] of themed) material.color.set(css(name));
    redraw();
  }

  new ResizeObserver(() => {
    const { clientWidth: width, clientHeight: height } = host;
    if (!width || !height) return;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    moved ? redraw() : reset();
  }).observe(host);

  recolour();
  reset();
  return { show, showSolids, reset, recolour, draw };
}

/**
 * Returns points that enclose the motion: origins and shapes of the bodies at some knots, the path, and the target. If the
 * camera follows a body, the points enclose the robot at the first knot.
 * Also returns the height of the lowest centre of a shape, which tells whether the robot stays above the ground.
 */
function cloudOf({ scene: { bodies, poses: all, trail, meshes, follow }, target }) {
  const poses = follow == null ? all : all.slice(0, 1);
  const boxes = bodies.map((body) => body.shapes.filter((shape) => shape.kind === "mesh").flatMap((shape) => cornersOf(shape, meshes[shape.part])));
  const points = [...(trail ?? []), ...(target ? [target] : [])].map((p) => new THREE.Vector3().fromArray(p));
  const q = new THREE.Quaternion(), o = new THREE.Vector3();
  let lowest = 0;
  const stride = Math.max(1, Math.floor(poses.length / 24));
  for (let k = 0; k < poses.length; k += stride) {
    bodies.forEach((body, b) => {
      o.fromArray(poses[k][b]);
      q.fromArray(poses[k][b], 3);
      if (body.shapes.length || (b === 0 && follow == null)) points.push(o.clone());
      const corners = boxes[b].map((corner) => corner.clone().applyQuaternion(q).add(o));
      points.push(...corners);
      // opposite corners of each box
      for (let i = 0; i < corners.length; i += 8) lowest = Math.min(lowest, (corners[i].z + corners[i + 7].z) / 2);
      for (const { kind, size, position } of body.shapes) {
        if (kind === "mesh") continue;
        const middle = new THREE.Vector3().fromArray(kind === "segment" ? size : position ?? [0, 0, 0], kind === "segment" ? 3 : 0);
        middle.applyQuaternion(q).add(o);
        lowest = Math.min(lowest, middle.z);
        const reach = { box: Math.hypot(...size) / 2, sphere: size[0], cylinder: Math.hypot(size[0], size[1] / 2), capsule: size[0] + size[1] / 2, segment: size[6] }[kind] ?? 0;
        points.push(middle.clone().addScalar(reach), middle.addScalar(-reach));
      }
    });
  }
  return { cloud: points, lowest };
}

/** Returns the geometry of a shape, or null if the shape has no extent. */
function geometryOf({ kind, size }) {
  switch (kind) {
    case "box": return new THREE.BoxGeometry(...size);
    case "sphere": return new THREE.SphereGeometry(size[0], 40, 24);
    case "ellipsoid": return new THREE.SphereGeometry(1, 40, 24); // the caller scales it
    // three.js draws these along y; in the data, as in a URDF, their axis is z
    case "cylinder": return new THREE.CylinderGeometry(size[0], size[0], size[1], 40).rotateX(Math.PI / 2);
    case "capsule": return new THREE.CapsuleGeometry(size[0], size[1], 12, 32).rotateX(Math.PI / 2);
    case "segment": return boneGeometry(size);
    default: return null;
  }
}

/** Returns a round bone between two points. It is thinner at its far end, which shows the direction of the chain. */
function boneGeometry([ax, ay, az, bx, by, bz, radius]) {
  const from = new THREE.Vector3(ax, ay, az), along = new THREE.Vector3(bx, by, bz).sub(from);
  const length = along.length();
  if (length < 1e-9) return null;
  const far = 0.68 * radius, outline = [];
  for (let i = 0; i <= 10; i++) {
    const a = (Math.PI / 2) * (i / 10);
    outline.push(new THREE.Vector2(radius * Math.sin(a), -radius * Math.cos(a)));
  }
  for (let i = 0; i <= 10; i++) {
    const a = (Math.PI / 2) * (i / 10);
    outline.push(new THREE.Vector2(far * Math.cos(a), length + far * Math.sin(a)));
  }
  const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
  return new THREE.LatheGeometry(outline, 28).applyQuaternion(turn).translate(ax, ay, az);
}

/** Returns a square grid in the plane z = 0, split into cells so that fog is computed for each cell's distance. */
function gridGeometry(pitch, cells) {
  const points = [], half = (cells / 2) * pitch;
  for (let i = 0; i <= cells; i++) {
    const x = i * pitch - half;
    for (let j = 0; j < cells; j++) {
      const y = j * pitch - half;
      points.push(x, y, 0, x, y + pitch, 0, y, x, 0, y + pitch, x, 0);
    }
  }
  return new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
}
