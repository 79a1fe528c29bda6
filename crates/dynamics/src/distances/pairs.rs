//! Pairs of geometries, prepared for one robot.

use super::lanes::{self, COMPONENTS, Columns, Item, PADDING, ROW, Row, Signs, Slopes};
use super::prepared::Method;
use super::results::Distances;
use super::round::{Witness, norm};
use super::solid::{Solid, distance, is_exact};
use crate::passes::frames::Placements;
use alloc::vec::Vec;
use condyle_linalg::{check, check_index};
use condyle_model::{Error, Geometry, GeometryPair, Model, Shape};
use condyle_spatial::{Act, Force, Motion, Se3, Vec3};

/// Geometry of a pair that is replaced by a capsule, because the exact distance of the pair is not available.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Replacement {
    /// Index of the pair.
    pub pair: usize,
    /// Index of the geometry in the pair: 0 for the first, 1 for the second.
    pub side: usize,
    /// Cylinder or ellipsoid that is replaced.
    pub shape: Shape,
    /// Capsule that contains the shape.
    pub capsule: Shape,
}

/// Geometry that is prepared for distances.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// Geometry as the caller gave it.
    geometry: Geometry,
    /// Shape that is used: the geometry's shape, or the capsule that replaces it.
    shape: Shape,
    /// Index of the body; 0 is the world.
    pub(crate) body: usize,
    /// Pose of the geometry's frame in the internal frame of its body, which is rotated to the joint axis.
    frame: Se3<f64>,
    /// Shape in the internal frame of the body.
    pub(crate) solid: Solid,
    /// Centre of the bounding sphere in the internal frame of the body, and its radius.
    bound: (Vec3<f64>, f64),
    /// Whether a pair needs the shape in the world, and not only the row of a sphere or capsule.
    is_general: bool,
    /// Velocity of the shape's origin, and angular velocity, along the world's axes; 0 on the robot.
    velocity: Motion<f64>,
}

impl Placed {
    /// Returns the geometry as the caller gave it, the shape that is used, and the pose of the geometry's frame.
    pub(super) fn parts(&self) -> (&Geometry, Shape, Se3<f64>) {
        (&self.geometry, self.shape, self.frame)
    }

    /// Gives the shape a pose in the geometry's frame.
    fn place(&mut self, placement: Se3<f64>) {
        self.geometry.placement = placement;
        let pose = self.frame * placement;
        self.solid = Solid::new(&self.shape, &pose);
        let (center, radius) = self.shape.bounding_sphere();
        self.bound = (pose.act(center), radius);
    }
}

/// Coordinate that changes a distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathColumn {
    /// Index of the joint column.
    pub column: usize,
    /// Index of the coordinate in the tangent of q.
    pub coordinate: usize,
    /// Ratio of the column, with a minus sign if the column moves the second body.
    pub ratio: f64,
}

/// Pair of geometries, as indices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    /// Indices of both geometries.
    pub geometries: [usize; 2],
    /// First column of the path between both bodies, and the index after the last.
    pub path: [usize; 2],
    /// Method of computing the distance.
    method: Method,
}

/// Pairs of geometries, prepared for one robot: poses in bodies, and the joints between both bodies of each pair.
///
/// Equal geometries in several pairs are moved to the world once. See the [module](super) for equations and an example.
#[derive(Clone, Debug)]
pub struct DistancePairs {
    pub(crate) geometries: Vec<Placed>,
    pub(crate) pairs: Vec<Pair>,
    pub(crate) path: Vec<PathColumn>,
    /// Pairs of spheres, and pairs of capsules.
    spheres: Vec<Item>,
    capsules: Vec<Item>,
    /// Indices of all other pairs.
    others: Vec<usize>,
    /// Signs of columns for gradients in lanes, for each pair of bodies. Empty if coordinates drive several columns.
    signs: Vec<Signs>,
    /// Index of the signs of each pair.
    sign_of: Vec<u32>,
    replacements: Vec<Replacement>,
    cutoff: f64,
    pub(crate) nv: usize,
    bodies: usize,
}

impl DistancePairs {
    /// Prepares pairs of geometries for a robot.
    ///
    /// # Errors
    /// Returns [`Error::Geometry`], with the index of the pair and the field, for an unknown frame and for numbers that
    /// are not finite or have the wrong sign. Other causes are a pair without a frame, a geometry with itself, two
    /// geometries of one moving body, two half-spaces, a pair that is listed twice, and two different geometries of one
    /// name.
    pub fn new(model: &Model, pairs: &[GeometryPair]) -> Result<Self, Error> {
        let mut all = Self {
            geometries: Vec::new(),
            pairs: Vec::with_capacity(pairs.len()),
            path: Vec::new(),
            spheres: Vec::new(),
            capsules: Vec::new(),
            others: Vec::new(),
            signs: Vec::new(),
            sign_of: Vec::new(),
            replacements: Vec::new(),
            cutoff: f64::INFINITY,
            nv: model.nv(),
            bodies: model.nodes().len(),
        };
        let is_dense = model.columns().iter().enumerate().all(|(k, c)| c.coordinate == k && c.ratio == 1.0);
        let mut rows = Vec::new();
        let placed = GeometryPair::resolve_all(model, pairs)?;
        for (pair, (both, [first, second])) in pairs.iter().zip(placed).enumerate() {
            let exact = is_exact(&both.first.shape, &both.second.shape);
            let mut geometries = [0; 2];
            for (side, (geometry, body, pose)) in
                [(&both.first, first.0, first.1), (&both.second, second.0, second.1)].into_iter().enumerate()
            {
                let shape = if exact { geometry.shape } else { geometry.shape.containing_capsule() };
                if shape != geometry.shape {
                    all.replacements.push(Replacement { pair, side, shape: geometry.shape, capsule: shape });
                }
                let turned = Se3::new(model.nodes()[body].axis_rotation.transpose(), Vec3::zero());
                geometries[side] = all.add(geometry, shape, body, turned * pose);
            }
            let begin = all.path.len();
            add_path(model, [first.0, second.0], &mut all.path);
            let [a, b] = geometries;
            let method = Method::of(&all.geometries[a].solid, &all.geometries[b].solid);
            match method {
                Method::Spheres => all.spheres.push(item(pair, a, b)),
                Method::Capsules | Method::CapsuleAndSphere => all.capsules.push(item(pair, a, b)),
                Method::Plane | Method::Other => {
                    all.others.push(pair);
                    all.geometries[a].is_general = true;
                    all.geometries[b].is_general = true;
                }
            }
            all.pairs.push(Pair { geometries, path: [begin, all.path.len()], method });
            if is_dense {
                all.add_signs([first.0, second.0], begin, &mut rows);
            }
        }
        Ok(all)
    }

    /// Adds a geometry unless an equal one exists. Returns its index.
    fn add(&mut self, geometry: &Geometry, shape: Shape, body: usize, pose: Se3<f64>) -> usize {
        let same = |placed: &Placed| placed.shape == shape && placed.geometry == *geometry;
        if let Some(index) = self.geometries.iter().position(same) {
            return index;
        }
        let mut placed = Placed {
            geometry: geometry.clone(),
            shape,
            body,
            frame: pose * geometry.placement.inverse(),
            solid: Solid::new(&shape, &pose),
            bound: (Vec3::zero(), 0.0),
            is_general: false,
            velocity: Motion::zero(),
        };
        let (center, radius) = shape.bounding_sphere();
        placed.bound = (pose.act(center), radius);
        self.geometries.push(placed);
        self.geometries.len() - 1
    }

    /// Adds the signs of the columns between two bodies, unless `rows` already contains the bodies.
    fn add_signs(&mut self, bodies: [usize; 2], begin: usize, rows: &mut Vec<[usize; 2]>) {
        let row = rows.iter().position(|row| *row == bodies).unwrap_or_else(|| {
            let mut signs = Signs::new(self.blocks());
            for path in &self.path[begin..] {
                signs.set(path.coordinate, path.ratio);
            }
            self.signs.push(signs);
            rows.push(bodies);
            rows.len() - 1
        });
        self.sign_of.push(row as u32);
    }

    /// Returns the number of blocks of columns.
    fn blocks(&self) -> usize {
        self.nv.div_ceil(PADDING)
    }

    /// Returns the number of pairs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Returns whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// Returns the number of degrees of freedom of the robot, which is the length of a gradient.
    pub fn nv(&self) -> usize {
        self.nv
    }

    /// Returns the geometries that a capsule replaces, because the exact distance of their pair is not available.
    pub fn replacements(&self) -> &[Replacement] {
        &self.replacements
    }

    /// Returns the number of different geometries.
    pub fn geometry_count(&self) -> usize {
        self.geometries.len()
    }

    /// Returns a geometry, with its latest placement.
    ///
    /// # Panics
    /// Panics if the geometry does not exist.
    #[track_caller]
    pub fn geometry(&self, geometry: usize) -> &Geometry {
        check_index("geometry", geometry, self.geometries.len(), "geometries");
        &self.geometries[geometry].geometry
    }

    /// Returns the indices of both geometries of a pair.
    ///
    /// # Panics
    /// Panics if the pair does not exist.
    #[track_caller]
    pub fn geometries_of(&self, pair: usize) -> [usize; 2] {
        check_index("pair", pair, self.pairs.len(), "pairs");
        self.pairs[pair].geometries
    }

    /// Returns the index of the first geometry with a name; `None` if no geometry has this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.geometries.iter().position(|placed| placed.geometry.name == name)
    }

    /// Sets the placement of a geometry: the pose of its shape in the world for an obstacle, or in its frame. The next
    /// evaluation uses it. All pairs of the geometry follow. Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
    /// use condyle_dynamics::{Data, Mat3, Se3, forward_kinematics, robots};
    /// let arm = robots::arm7();
    /// let tool = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    /// let ball = Geometry::in_world(Shape::sphere([0.0; 3], 0.1)).named("ball");
    /// let mut pairs = DistancePairs::new(&arm, &[GeometryPair::new(tool, ball)])?;
    /// let (mut data, mut distances) = (Data::new(&arm), Distances::new(&pairs));
    /// let placements = forward_kinematics(&arm, &mut data, &[0.3; 7]);
    /// let at_tool = Se3::new(Mat3::identity(), placements.frame(arm.frame("tool")?).translation);
    /// pairs.place(pairs.find("ball").unwrap(), at_tool); // the obstacle moved to the tool
    /// pairs.values(placements, &mut distances);
    /// assert!((distances.distance(0) + 0.15).abs() < 1e-12);
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the geometry does not exist, or if the placement has a number that is not finite.
    #[track_caller]
    pub fn place(&mut self, geometry: usize, placement: Se3<f64>) {
        check_index("geometry", geometry, self.geometries.len(), "geometries");
        let Se3 { rotation, translation } = placement;
        let finite = rotation.is_rotation() && translation.to_array().iter().all(|x| x.is_finite());
        assert!(finite, "placement: expected a rotation and a finite translation, found {placement:?}");
        self.change(geometry, |placed| placed.place(placement));
    }

    /// Changes a geometry, and the capsule that replaces it in some of its pairs.
    fn change(&mut self, geometry: usize, change: impl Fn(&mut Placed)) {
        for other in 0..self.geometries.len() {
            if other != geometry && self.geometries[other].geometry == self.geometries[geometry].geometry {
                change(&mut self.geometries[other]);
            }
        }
        change(&mut self.geometries[geometry]);
    }

    /// Sets the velocity of a geometry that is fixed to the world: the linear velocity of the origin of its placement
    /// and its angular velocity, along the world's axes (m/s, rad/s). [`rate`](Self::rate) uses it. The placement stays
    /// until [`place`](Self::place) changes it.
    ///
    /// ```
    /// use condyle_dynamics::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
    /// use condyle_dynamics::{Data, Motion, Vec3, forward_kinematics, robots};
    /// let arm = robots::arm7();
    /// let tool = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    /// let floor = Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 0.0 };
    /// let lift = Geometry::in_world(floor).named("lift");
    /// let mut pairs = DistancePairs::new(&arm, &[GeometryPair::new(tool, lift)])?;
    /// pairs.set_velocity(pairs.find("lift").unwrap(), Motion::new(Vec3::new(0.0, 0.0, 0.2), Vec3::zero()));
    /// let mut distances = Distances::new(&pairs);
    /// pairs.values(forward_kinematics(&arm, &mut Data::new(&arm), &[0.3; 7]), &mut distances);
    /// assert!((pairs.rate(&distances, 0) + 0.2).abs() < 1e-15); // the floor comes nearer
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the geometry does not exist or is on the robot, or if a number is not finite.
    #[track_caller]
    pub fn set_velocity(&mut self, geometry: usize, velocity: Motion<f64>) {
        check_index("geometry", geometry, self.geometries.len(), "geometries");
        let Placed { geometry: given, .. } = &self.geometries[geometry];
        assert!(given.frame.is_none(), "geometry {given}: expected a geometry in the world");
        let is_finite = velocity.to_array().iter().all(|x| x.is_finite());
        assert!(is_finite, "velocity: expected finite numbers, found {velocity:?}");
        self.change(geometry, |placed| placed.velocity = velocity);
    }

    /// Returns the velocity of a geometry; 0 unless [`set_velocity`](Self::set_velocity) set it.
    ///
    /// # Panics
    /// Panics if the geometry does not exist.
    #[track_caller]
    pub fn velocity(&self, geometry: usize) -> Motion<f64> {
        check_index("geometry", geometry, self.geometries.len(), "geometries");
        self.geometries[geometry].velocity
    }

    /// Returns ∂d/∂t, the derivative of the distance of a pair by time while the robot stands still (m/s). It follows
    /// from the [velocities](Self::set_velocity) of obstacles: d' = ∂d/∂q v + ∂d/∂t. `distances` are the results of
    /// the last evaluation.
    ///
    /// # Panics
    /// Panics if the pair does not exist.
    #[track_caller]
    pub fn rate(&self, distances: &Distances, pair: usize) -> f64 {
        check_index("pair", pair, self.pairs.len(), "pairs");
        let (geometries, points) = (self.pairs[pair].geometries, distances.points(pair));
        let velocity = |side: usize| {
            let Placed { geometry, velocity, .. } = &self.geometries[geometries[side]];
            velocity.linear + velocity.angular.cross(points[side] - geometry.placement.translation)
        };
        distances.normal(pair).dot(velocity(0) - velocity(1)) // n·(ṗ₁ − ṗ₂)
    }

    /// Sets the largest distance of interest (m); infinite at first. Pairs whose bounding spheres are farther apart are
    /// not computed: their result is a lower bound, and [`Distances::is_near`] returns `false` for them.
    ///
    /// # Panics
    /// Panics if the distance is NaN.
    #[track_caller]
    pub fn set_cutoff(&mut self, distance: f64) {
        assert!(!distance.is_nan(), "distance: expected a number, found NaN");
        self.cutoff = distance;
    }

    /// Returns the largest distance of interest (m).
    pub fn cutoff(&self) -> f64 {
        self.cutoff
    }

    /// Computes distances, witness points and normals of all pairs. Costs O(pairs) and allocates nothing.
    ///
    /// # Panics
    /// Panics if the placements belong to a robot with another number of bodies, or if `distances` was made for other
    /// pairs.
    #[track_caller]
    pub fn values(&self, placements: Placements<'_, f64>, distances: &mut Distances) {
        self.check(placements, distances);
        self.evaluate(placements, distances);
    }

    /// Computes distances, witness points, normals and gradients of all pairs. The equation is in the [module](super).
    /// Costs O(pairs · depth) and allocates nothing.
    ///
    /// # Panics
    /// Panics if the placements belong to a robot with another number of bodies, or if `distances` was made for other
    /// pairs.
    #[track_caller]
    pub fn gradients(&self, placements: Placements<'_, f64>, distances: &mut Distances) {
        self.check(placements, distances);
        self.evaluate(placements, distances);
        let columns = &placements.world.S;
        if !self.signs.is_empty() {
            let (blocks, _) = distances.columns.as_chunks_mut::<COMPONENTS>();
            for (columns, block) in columns.chunks(PADDING).zip(blocks) {
                for (lane, column) in columns.iter().enumerate() {
                    for (x, to) in column.to_array().into_iter().zip(&mut *block) {
                        to.0[lane] = x;
                    }
                }
            }
            let Distances { columns, found, gradients, .. } = distances;
            let Self { signs, sign_of, nv, .. } = self;
            lanes::gradients(&Slopes { columns, signs, sign_of, results: found, nv: *nv }, gradients);
        } else {
            distances.gradients.fill(0.0);
            for (k, pair) in self.pairs.iter().enumerate() {
                let row = &mut distances.gradients[k * self.nv..][..self.nv];
                // the line of the force n contains both witness points, so one moment serves for both bodies
                let [_, x, y, z, nx, ny, nz, _] = distances.found[k];
                let f = Force::at_point(Vec3::new(x, y, z), Vec3::new(nx, ny, nz));
                for path in &self.path[pair.path[0]..pair.path[1]] {
                    row[path.coordinate] += path.ratio * columns[path.column].dot(f); // nᵀ (J₁ − J₂)
                }
            }
        }
        if self.cutoff < f64::INFINITY {
            for (k, _) in distances.near.iter().enumerate().filter(|(_, near)| !**near) {
                distances.gradients[k * self.nv..][..self.nv].fill(0.0);
            }
        }
    }

    /// Panics unless placements and results fit these pairs.
    #[track_caller]
    fn check(&self, placements: Placements<'_, f64>, distances: &Distances) {
        check("placements", placements.model.nodes().len(), self.bodies);
        check("distances", distances.distances.len(), self.pairs.len());
        check("distances", distances.solids.len(), self.geometries.len());
    }

    /// Computes distances, witness points and normals.
    fn evaluate(&self, placements: Placements<'_, f64>, distances: &mut Distances) {
        let Distances { solids, rounds, items, found, near, .. } = distances;
        for (g, placed) in self.geometries.iter().enumerate() {
            let X = if placed.body == 0 { Se3::identity() } else { placements.world.oX[placed.body] };
            if let Solid::Sphere(round) | Solid::Capsule(round) = &placed.solid {
                rounds[g] = lanes::row(&round.moved(&X));
            }
            if placed.is_general {
                solids[g].0 = placed.solid.moved(&X);
            }
            if self.cutoff < f64::INFINITY {
                solids[g].1 = X.act(placed.bound.0);
            }
        }
        if self.cutoff == f64::INFINITY {
            near.fill(true);
            for &k in &self.others {
                let [a, b] = self.pairs[k].geometries;
                found[k] = row_of(&distance(&solids[a].0, &solids[b].0));
            }
            lanes::compute(&self.spheres, rounds, true, found);
            lanes::compute(&self.capsules, rounds, false, found);
        } else {
            let (mut front, mut back) = (0, items.len());
            for (k, &Pair { geometries: [a, b], method, .. }) in self.pairs.iter().enumerate() {
                let far = self.beyond([a, b].map(|g| (solids[g].1, self.geometries[g].bound.1)));
                near[k] = far.is_none();
                match (far, method) {
                    (Some(far), _) => found[k] = row_of(&far),
                    (None, Method::Spheres) => {
                        items[front] = item(k, a, b);
                        front += 1;
                    }
                    (None, Method::Capsules | Method::CapsuleAndSphere) => {
                        back -= 1;
                        items[back] = item(k, a, b);
                    }
                    (None, Method::Plane | Method::Other) => found[k] = row_of(&distance(&solids[a].0, &solids[b].0)),
                }
            }
            lanes::compute(&items[..front], rounds, true, found);
            lanes::compute(&items[back..], rounds, false, found);
        }
        for (distance, row) in distances.distances.iter_mut().zip(&distances.found) {
            *distance = row[0];
        }
    }

    /// Returns the distance of two bounding spheres if it is larger than the largest distance of interest.
    fn beyond(&self, [(p, radius), (q, its)]: [(Vec3<f64>, f64); 2]) -> Option<Witness<f64>> {
        let reach = self.cutoff + radius + its;
        let d = p - q;
        if reach == f64::INFINITY || reach < 0.0 || d.norm_squared() <= reach * reach {
            return None;
        }
        let length = norm(d);
        let witness = Witness { distance: length, points: [p, q], normal: d.scale(1.0 / length) };
        Some(witness.enlarged(radius, its))
    }
}

/// Appends the columns between two bodies to `path`. A column that moves both bodies does not change their distance.
pub(super) fn add_path(model: &Model, bodies: [usize; 2], path: &mut Vec<PathColumn>) {
    let supports = bodies.map(|body| model.support(&model.nodes()[body]));
    for (side, sign) in [(0, 1.0), (1, -1.0)] {
        for &c in supports[side].iter().filter(|c| !supports[1 - side].contains(c)) {
            let column = &model.columns()[c];
            path.push(PathColumn { column: c, coordinate: column.coordinate, ratio: sign * column.ratio });
        }
    }
}

/// Returns the item of pair k with the geometries a and b.
fn item(k: usize, a: usize, b: usize) -> Item {
    [k as u32, a as u32, b as u32]
}

/// Returns the row of a result.
fn row_of(w: &Witness<f64>) -> Row {
    let (p, n) = (w.points[0], w.normal);
    [w.distance, p.x, p.y, p.z, n.x, n.y, n.z, 0.0]
}

impl Distances {
    /// Allocates the results of prepared pairs.
    pub fn new(pairs: &DistancePairs) -> Self {
        let (n, blocks) = (pairs.len(), pairs.blocks());
        Self {
            solids: pairs.geometries.iter().map(|placed| (placed.solid, Vec3::zero())).collect(),
            rounds: vec![[0.0; ROW]; pairs.geometries.len()],
            items: vec![[0; 3]; n],
            found: vec![[0.0; ROW]; n],
            distances: vec![0.0; n],
            near: vec![false; n],
            columns: vec![Columns::default(); COMPONENTS * blocks],
            gradients: vec![0.0; n * pairs.nv() + PADDING],
            nv: pairs.nv(),
        }
    }
}
