//! Order of a function's steps in which few values are needed at the same time.

use crate::graph::Id;
use crate::step::Step;
use crate::steps::Steps;
use std::collections::BTreeSet;

/// Number of a processor's registers. In a good order, at most this number of values is needed at the same time.
const REGISTERS: usize = 16;

/// Applies the better of two orders: the order of the recording, or an order in which each value is computed
/// immediately before its first use.
pub(crate) fn order(steps: &mut Steps) {
    let late = on_demand(steps);
    let recorded: Vec<usize> = (0..steps.all.len()).collect();
    let best = if transfers(steps, &late) < transfers(steps, &recorded) { late } else { recorded };
    steps.all = best.into_iter().map(|k| steps.all[k].clone()).collect();
}

/// Returns an order of the steps: for one result after the other, the steps that this result needs and no earlier
/// result needed.
fn on_demand(steps: &Steps) -> Vec<usize> {
    let mut order = Vec::with_capacity(steps.all.len());
    let mut taken = vec![false; steps.all.len()];
    let mut maker = vec![usize::MAX; steps.values];
    for (k, step) in steps.all.iter().enumerate() {
        step.makes().for_each(|id| maker[id as usize] = k);
    }
    let weight = weights(steps, &maker);
    for &result in steps.results {
        let mut stack = vec![(maker[result as usize], false)];
        while let Some((k, ready)) = stack.pop() {
            if k == usize::MAX || taken[k] {
                continue;
            }
            if ready {
                taken[k] = true;
                order.push(k);
                continue;
            }
            stack.push((k, true));
            // Compute the operand that needs the most registers first: its step is pushed last onto the stack.
            let mut before: Vec<usize> = steps.all[k].takes().map(|id| maker[id as usize]).collect();
            before.retain(|&j| j != usize::MAX);
            before.sort_by_key(|&j| (weight[j], j));
            stack.extend(before.into_iter().map(|j| (j, false)));
        }
    }
    order
}

/// Returns, for each step, the number of registers needed to compute the step and all its operands. This number assumes
/// that no two steps share an operand (Sethi and Ullman, *The generation of optimal code for arithmetic expressions*,
/// 1970).
fn weights(steps: &Steps, maker: &[usize]) -> Vec<u32> {
    let mut weight: Vec<u32> = Vec::with_capacity(steps.all.len());
    for step in &steps.all {
        let mut before: Vec<u32> = step.takes().filter_map(|id| weight.get(maker[id as usize]).copied()).collect();
        before.sort_unstable_by(|a, b| b.cmp(a));
        let most = before.iter().enumerate().map(|(k, &w)| w + k as u32).max().unwrap_or(1);
        weight.push(most.min(1 << 20));
    }
    weight
}

/// Returns the number of transfers between registers and memory in this order. If all registers are full, the value
/// whose next use is latest moves to memory (Belady, *A study of replacement algorithms for a virtual-storage
/// computer*, 1966).
fn transfers(steps: &Steps, order: &[usize]) -> usize {
    let never = order.len();
    let mut uses: Vec<Vec<usize>> = vec![Vec::new(); steps.values];
    for (time, &k) in order.iter().enumerate().rev() {
        steps.all[k].takes().for_each(|id| uses[id as usize].push(time)); // the last entry is the next use
    }
    let mut is_free = vec![true; steps.values]; // inputs and constants are in memory anyway, so moving them is free
    steps.all.iter().flat_map(Step::makes).for_each(|id| is_free[id as usize] = false);
    let mut held: BTreeSet<(usize, Id)> = BTreeSet::new();
    let mut in_register = vec![false; steps.values];
    let mut stored = vec![false; steps.values];
    let mut count = 0;
    for (time, &k) in order.iter().enumerate() {
        let step: &Step = &steps.all[k];
        let mut seen: Vec<Id> = step.takes().collect();
        seen.sort_unstable();
        seen.dedup();
        for id in seen {
            if in_register[id as usize] {
                held.remove(&(time, id));
            } else {
                count += 1; // the value is loaded
            }
            while uses[id as usize].last().is_some_and(|&t| t <= time) {
                uses[id as usize].pop();
            }
            in_register[id as usize] = false;
            if let Some(&next) = uses[id as usize].last() {
                held.insert((next, id));
                in_register[id as usize] = true;
                stored[id as usize] |= is_free[id as usize];
            }
        }
        for id in step.makes() {
            held.insert((uses[id as usize].last().copied().unwrap_or(never), id));
            in_register[id as usize] = true;
        }
        while held.len() > REGISTERS {
            let Some((next, id)) = held.pop_last() else { break };
            in_register[id as usize] = false;
            if next < never && !stored[id as usize] {
                stored[id as usize] = true;
                count += 1;
            }
        }
    }
    count
}
