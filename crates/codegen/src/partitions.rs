//! Partitions of a function. If one thread would need more registers than it has, several threads compute one state;
//! each thread computes some of the results.
//!
//! Results are divided by limbs. A limb is a subtree without forks that is attached to a body with several children, or
//! to the world. The bodies that carry limbs are the trunk. In matrices a limb owns the columns of its coordinates, and
//! in vectors the entries of its coordinates; the trunk owns the rest. A value can be stored at several indices, for
//! example in a symmetric matrix. Such a value is computed once, and belongs to the limb that owns the first of these
//! indices. The value belongs to the trunk only if the trunk owns all of these indices.
//!
//! Each partition is itself a function: the original function without the results of the other partitions, and without
//! the values that only those results need. So threads neither wait for each other nor share memory. A value that
//! several partitions need, such as a value of the trunk, is computed by each of these partitions. The number of such
//! values determines whether a split saves time. With few states, some threads of the GPU are idle, and a call takes as
//! long as the largest partition. With many states, a call takes as long as all partitions together:
//!
//! ```text
//! gain = whole / largest partition      loss = sum of partitions / whole      worth = gain / loss      in operations
//! ```
//!
//! The search begins with a partition for each limb, and repeatedly merges the two partitions whose union gives the
//! greatest worth (gain / loss). The best of all splits in this sequence is used. The last of them is the whole
//! function. For efforts and accelerations the whole function is best, since the trunk needs the values of all limbs.
//! For derivatives, most limbs have their own partition.
//!
//! All partitions together cost more than the whole function. So a kernel contains both the whole function and its
//! partitions, and each launch selects one of these forms. A launch uses the partitions if the threads of all
//! partitions and states fit on the device at the same time.

use crate::function::{Function, is_needed, needed};
use crate::graph::{Id, Node};
use crate::program::Program;
use condyle_model::Model;
use core::cmp::Reverse;
use std::collections::{BTreeSet, HashMap};

/// Maximum number of registers, of 32 bits each, in which a thread can hold values.
const REGISTERS: usize = 255;

/// Returns the limb of each result of a robot's function. A result belongs to the trunk (0) if no limb owns its column
/// or its entry.
pub(crate) fn limbs_of_results(model: &Model, function: &Function) -> Vec<usize> {
    let of_coordinate = limbs(model);
    let own = |&(array, place): &(usize, usize)| {
        let array = &function.outputs[array];
        match (array.rows, array.columns) {
            (rows, columns) if columns == model.nv() => of_coordinate[place / rows],
            (rows, 1) if rows == model.nv() => of_coordinate[place],
            _ => 0,
        }
    };
    let mut of_result: Vec<usize> = function.places.iter().map(own).collect();
    let mut of_value: HashMap<Id, usize> = HashMap::new();
    for (&id, &limb) in function.results.iter().zip(&of_result) {
        let first = of_value.entry(id).or_insert(limb);
        *first = if *first == 0 { limb } else { *first };
    }
    for (limb, &id) in of_result.iter_mut().zip(&function.results) {
        if is_operation(function.nodes[id as usize]) {
            *limb = of_value[&id];
        }
    }
    of_result
}

/// Returns the limb of each coordinate of a robot; 0 is the trunk.
fn limbs(model: &Model) -> Vec<usize> {
    let nodes = model.nodes();
    let mut children = vec![0; nodes.len()];
    nodes.iter().skip(1).for_each(|node| children[node.parent] += 1);
    // The trunk consists of the bodies with several children, and of all bodies between these and the world.
    let mut bears_limbs: Vec<bool> = children.iter().map(|&n| n > 1).collect();
    for i in (1..nodes.len()).rev() {
        bears_limbs[nodes[i].parent] |= bears_limbs[i];
    }
    let (mut of_body, mut of_coordinate, mut count) = (vec![0; nodes.len()], vec![0; model.nv()], 0);
    for (i, node) in nodes.iter().enumerate().skip(1).filter(|&(i, _)| !bears_limbs[i]) {
        of_body[i] = of_body[node.parent];
        if of_body[i] == 0 {
            count += 1; // a limb begins here
            of_body[i] = count;
        }
        of_coordinate[node.idx_v..][..node.joint.nv()].fill(of_body[i]);
    }
    of_coordinate
}

/// Set of limbs, and the operations that the results of these limbs need.
#[derive(Clone)]
struct Partition {
    limbs: Vec<usize>,
    /// Whether each value is an operation of this partition.
    operations: Vec<bool>,
    count: usize,
}

impl Partition {
    fn new(function: &Function, limb: usize) -> Self {
        let results = function.results.iter().zip(&function.limbs).filter(|&(_, &of)| of == limb);
        let is_needed = is_needed(&function.nodes, results.map(|(&id, _)| id));
        let operations = is_needed.iter().zip(&function.nodes).map(|(&needed, &node)| needed && is_operation(node));
        Self::of(vec![limb], operations.collect())
    }

    fn of(limbs: Vec<usize>, operations: Vec<bool>) -> Self {
        let count = operations.iter().filter(|&&is_one| is_one).count();
        Self { limbs, operations, count }
    }

    fn merged(&self, other: &Self) -> Self {
        let operations = self.operations.iter().zip(&other.operations).map(|(a, b)| a | b).collect();
        Self::of([&self.limbs[..], &other.limbs].concat(), operations)
    }
}

/// Returns whether an operation computes the value. A change of sign does not count as an operation.
fn is_operation(node: Node) -> bool {
    !matches!(node, Node::Constant(_) | Node::Input(_) | Node::Neg(_) | Node::Minus(_))
}

/// Returns the cost of a split: the size of the largest partition times the sum of all sizes. The smallest cost is
/// best.
fn cost(counts: impl Iterator<Item = usize> + Clone) -> u128 {
    counts.clone().max().unwrap_or(0) as u128 * counts.sum::<usize>() as u128
}

/// Returns the two partitions whose union gives the smallest cost, and this cost.
fn best_pair(partitions: &[Partition]) -> Option<(u128, [usize; 2])> {
    let pairs = (0..partitions.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
    let costs = pairs.map(|[a, b]| {
        let others =
            partitions.iter().enumerate().filter(move |&(k, _)| k != a && k != b).map(|(_, partition)| partition.count);
        (cost(others.chain([partitions[a].merged(&partitions[b]).count])), [a, b])
    });
    costs.min()
}

/// Returns the partitions of a function, the largest first. The list is empty if the function is not split. Each number
/// takes `registers_of_number` registers.
pub(crate) fn split(program: &Program, registers_of_number: usize) -> Vec<Function> {
    let function = program.function;
    let spills = registers_of_number * program.most_alive > REGISTERS;
    if function.partitions.map_or(!spills, |number| number.get() == 1) {
        return Vec::new();
    }
    let limbs: BTreeSet<usize> = function.limbs.iter().copied().collect();
    let mut partitions: Vec<Partition> = limbs.into_iter().map(|limb| Partition::new(function, limb)).collect();
    let mut best = partitions.clone();
    let mut least = cost(partitions.iter().map(|partition| partition.count));
    while let Some((cost, [a, b])) = best_pair(&partitions) {
        let other = partitions.remove(b);
        partitions[a] = partitions[a].merged(&other);
        if function.partitions.map_or(cost <= least, |number| best.len() > number.get()) {
            (least, best) = (cost, partitions.clone());
        }
    }
    if best.len() < 2 {
        return Vec::new();
    }
    best.sort_by_key(|partition| Reverse(partition.count));
    best.iter().enumerate().map(|(k, partition)| function.partition(k, &partition.limbs)).collect()
}

impl Function {
    /// Returns the function with only the results of these limbs.
    fn partition(&self, k: usize, limbs: &[usize]) -> Self {
        let kept = || (0..self.results.len()).filter(|&k| limbs.contains(&self.limbs[k]));
        let results: Vec<Id> = kept().map(|k| self.results[k]).collect();
        let (nodes, results) = needed(&self.nodes, &results);
        Self {
            name: format!("{}_partition{k}", self.name),
            about: self.about.clone(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            nodes,
            results,
            places: kept().map(|k| self.places[k]).collect(),
            limbs: Vec::new(),
            partitions: None,
        }
    }
}
