//! Tests of the growth of an algorithm's work with the number of bodies. The tests count operations and do not measure
//! times.

use crate::common;
use crate::counted::{Counted, Operations, counted};

use common::{State, lift, random_inertia, random_pose, rng, tree};
use condyle_dynamics::{
    Cholesky, Data, ForwardDynamicsMethod, Joint, Ltdl, Model, ModelBuilder, Se3, Vec3, WORLD, aba,
    centroidal_map_rate, compute_all_terms, crba, forward_dynamics, forward_velocities, minv, nonlinear_effects, rnea,
    robots,
};

/// Creates a tree of n hinges. `parent` gives the index of a body's parent.
fn hinges(n: usize, parent: impl Fn(usize) -> usize) -> Model {
    let rng = &mut rng(n as u64);
    let mut builder = ModelBuilder::new("hinges");
    let mut ids = vec![WORLD];
    for i in 1..=n {
        let axis = Vec3::from(core::array::from_fn(|k| if k == i % 3 { 1.0 } else { 0.0 }));
        let joint = Joint::Revolute { axis };
        ids.push(builder.body(&format!("b{i}"), ids[parent(i)], joint, random_pose(rng), random_inertia(rng)));
    }
    builder.build().expect("a tree is well-formed")
}

/// Function that returns the index of a body's parent.
type Shape = fn(usize) -> usize;

/// Shapes of trees: a chain, a binary tree, a star about body 1, and a chain of branches.
const SHAPES: [(&str, Shape); 4] = [
    ("chain", |i| i - 1),
    ("binary tree", |i| i / 2),
    ("star", |i| if i > 1 { 1 } else { 0 }),
    ("caterpillar", |i| if i % 3 == 1 { i.saturating_sub(3) } else { i - 1 }),
];

/// Number of bodies by which trees grow. It is a multiple of 3 and 4, because joint axes repeat after 3 or 4 bodies,
/// and shapes repeat after 3 bodies.
const GROUP: usize = 12;

/// Number of operations of RNEA per hinge, as on the book's page on complexity.
const RNEA_PER_HINGE: u64 = 245;
const ABA_PER_HINGE: u64 = 629;
/// Number of operations that ABA omits at a hinge on the world, because the world's inertia is not needed.
const ABA_OF_A_ROOT: u64 = 150;
/// Numbers of operations of CRBA: per hinge, and per pair of a hinge and one of its ancestors.
const CRBA_PER_HINGE: f64 = 276.0;
const CRBA_PER_PAIR: f64 = 11.0;

/// Counts the operations of RNEA, CRBA and ABA at one state.
fn work(model: &Model) -> [Operations; 3] {
    let State { q, v, a, .. } = State::random(model, &mut rng(0));
    let [q, v, a]: [Vec<Counted>; 3] = [&q, &v, &a].map(|x| lift(x));
    let mut data = Data::new(model);
    [
        counted(|| rnea(model, &mut data, &q, &v, &a, &[])).0,
        counted(|| crba(model, &mut data, &q).as_slice()).0,
        counted(|| aba(model, &mut data, &q, &v, &a, &[])).0,
    ]
}

/// Returns Σ depth, the sum of the depths of all bodies. The depth of a body is the number of its ancestors plus one.
fn sum_of_depths(model: &Model) -> u64 {
    let mut depth = vec![0; model.bodies().len()];
    for (i, body) in model.bodies().iter().enumerate().skip(1) {
        depth[i] = depth[body.parent] + 1;
    }
    depth.iter().sum()
}

/// Checks that RNEA and ABA take the same number of operations for each additional body, for any shape of the tree.
#[test]
fn work_of_rnea_and_aba_is_linear() {
    for (name, parent) in SHAPES {
        let rows: Vec<[u64; 2]> = (1..=8)
            .map(|k| {
                let [rnea, _, aba] = work(&hinges(GROUP * k, parent));
                [rnea.flops(), aba.flops()]
            })
            .collect();
        for algorithm in 0..2 {
            let added: Vec<u64> = rows.windows(2).map(|w| w[1][algorithm] - w[0][algorithm]).collect();
            println!("{name}, {}: {} for each body more", ["rnea", "aba"][algorithm], added[0] as f64 / GROUP as f64);
            assert!(added.iter().all(|&x| x == added[0]), "{name}: {added:?}");
            assert_eq!(added[0], GROUP as u64 * [RNEA_PER_HINGE, ABA_PER_HINGE][algorithm]);
            assert_eq!(rows[0][algorithm] + [0, ABA_OF_A_ROOT][algorithm], added[0], "each shape has one root");
        }
    }
}

/// Checks that CRBA takes a + b n + c Σ depth operations, with the same a, b and c for all shapes of trees. Σ depth
/// grows like n² for a chain, like n log n for a balanced tree, and like n for a star.
#[test]
fn work_of_crba_is_the_sum_of_depths() {
    let seen: Vec<(f64, f64, f64)> = SHAPES
        .iter()
        .flat_map(|&(_, parent)| [GROUP, 2 * GROUP, 4 * GROUP].map(|n| hinges(n, parent)))
        .map(|model| (model.nv() as f64, sum_of_depths(&model) as f64, work(&model)[1].flops() as f64))
        .collect();
    // For a + b n + c Σ depth, compute c from a chain and a star of 4 groups, and a and b from two stars.
    let [chain, star, short] = [seen[2], seen[8], seen[6]];
    let c = (chain.2 - star.2) / (chain.1 - star.1);
    let b = (star.2 - short.2 - c * (star.1 - short.1)) / (star.0 - short.0);
    let a = star.2 - b * star.0 - c * star.1;
    println!("crba: {a} + {b} n + {c} Σ depth");
    assert!((b - CRBA_PER_HINGE).abs() < 1e-9 && (c - CRBA_PER_PAIR).abs() < 1e-9, "{a} + {b} n + {c} Σ depth");
    for (n, depths, found) in seen {
        assert!((a + b * n + c * depths - found).abs() < 1e-6 * found, "{n} bodies, Σ depth {depths}: {found}");
    }
}

/// Checks trees with other joint types: the number of operations per body is different, but the growth is still linear.
#[test]
fn with_slides_and_a_floating_base() {
    for floating in [false, true] {
        let rows: Vec<[u64; 2]> = (1..=6)
            .map(|k| {
                let [rnea, _, aba] = work(&tree(GROUP * k + usize::from(floating), floating, |i| i - 1));
                [rnea.flops(), aba.flops()]
            })
            .collect();
        for w in rows.windows(3) {
            for algorithm in 0..2 {
                assert_eq!(w[2][algorithm] - w[1][algorithm], w[1][algorithm] - w[0][algorithm]);
            }
        }
    }
}

/// Counts the operations of forward dynamics by a method.
fn forward(model: &Model, method: ForwardDynamicsMethod) -> Operations {
    let State { q, v, tau, .. } = State::random(model, &mut rng(0));
    let [q, v, tau]: [Vec<Counted>; 3] = [&q, &v, &tau].map(|x| lift(x));
    let mut data = Data::new(model);
    counted(|| forward_dynamics(model, &mut data, &q, &v, &tau, &[], Some(method))).0
}

/// Counts the operations of the function for all terms, and of single calls for the same terms.
fn terms(model: &Model) -> [Operations; 2] {
    let State { q, v, .. } = State::random(model, &mut rng(0));
    let [q, v]: [Vec<Counted>; 2] = [&q, &v].map(|x| lift(x));
    let mut data = Data::new(model);
    let together = counted(|| {
        _ = compute_all_terms(model, &mut data, &q, &v);
        &[]
    });
    let apart = counted(|| {
        _ = crba(model, &mut data, &q);
        _ = nonlinear_effects(model, &mut data, &q, &v);
        _ = centroidal_map_rate(model, &mut data, &q, &v);
        let velocities = forward_velocities(model, &mut data, &q, &v);
        _ = (velocities.kinetic_energy(), velocities.potential_energy());
        &[]
    });
    [together.0, apart.0]
}

/// Counts the operations of the dense and of the sparse factorisation of M.
fn factors(model: &Model) -> [Operations; 2] {
    let q = lift(&State::random(model, &mut rng(0)).q);
    let M = crba::<Counted, f64>(model, &mut Data::new(model), &q).clone();
    let (mut dense, mut sparse) = (Cholesky::new(model.nv()), Ltdl::new(model));
    let dense = counted(|| {
        dense.factorize(&M);
        &[]
    });
    let sparse = counted(|| {
        sparse.factorize(&M);
        &[]
    });
    [dense.0, sparse.0]
}

/// Creates one model that consists of `n` humanoids.
fn humanoids(n: usize) -> Model {
    let (one, mut builder) = (robots::humanoid(), ModelBuilder::new("crowd"));
    for k in 0..n {
        builder.append(WORLD, Se3::identity(), &one, &format!("{k}_"));
    }
    builder.build().expect("robots side by side are one")
}

/// Checks that the tables on the book's page on complexity contain the numbers that this test counts.
#[test]
fn the_book_has_these_figures() {
    let page = include_str!("../../../../docs/complexity.md");
    let robots = [robots::arm7(), robots::quadruped(), robots::humanoid()];
    let counts = robots.each_ref().map(|model| {
        let [rnea, crba, aba] = work(model);
        let State { q, v, .. } = State::random(model, &mut rng(0));
        let [q, v]: [Vec<Counted>; 2] = [&q, &v].map(|x| lift(x));
        let mut data = Data::new(model);
        let h = counted(|| nonlinear_effects(model, &mut data, &q, &v)).0;
        let inverse = counted(|| minv(model, &mut data, &q).as_slice()).0;
        let [dense, sparse] = [ForwardDynamicsMethod::Dense, ForwardDynamicsMethod::Sparse].map(|m| forward(model, m));
        let [together, apart] = terms(model);
        [rnea, h, crba, aba, dense, sparse, inverse, together, apart].map(Operations::flops)
    });
    let names = [
        "`rnea`",
        "`nonlinear_effects`",
        "`crba`",
        "`aba`",
        "$h$, $M$, dense factor",
        "$h$, $M$, sparse factor",
        "`minv`",
        "`compute_all_terms`",
        "the same, a call each",
    ];
    let rows = names.iter().enumerate().map(|(k, name)| (*name, counts.iter().map(|c| c[k]).collect::<Vec<u64>>()));
    let crowds = robots.into_iter().chain([4, 8].map(humanoids));
    let factors: Vec<[u64; 2]> = crowds.map(|model| factors(&model).map(Operations::flops)).collect();
    let of = |k: usize| factors.iter().map(|f| f[k]).collect();
    let rows = rows.chain([("dense factor", of(0)), ("sparse factor", of(1))]);
    let rows = rows.map(|(name, counts)| {
        let cells: Vec<String> = counts.iter().map(u64::to_string).collect();
        format!("| {name} | {} |", cells.join(" | "))
    });
    let missing: Vec<String> = rows.filter(|row| !page.contains(row)).collect();
    assert!(missing.is_empty(), "docs/complexity.md: expected the rows\n{}", missing.join("\n"));
}
