//! Counts the instructions of each call of chosen functions.
//!
//! A call begins with the block at the function's entry and ends when the return address is reached with the stack
//! pointer of the entry. Instructions of interrupt handlers that come in between do not count.

/// The smallest value of LR that means a return from an exception.
const EXC_RETURN: u32 = 0xFFFF_FF00;

/// Cost of a function.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TickStats {
    /// Calls that have returned.
    pub count: u64,
    /// Instructions in a call, on average.
    pub instructions_mean: f64,
    /// Instructions in the longest call.
    pub instructions_max: u64,
}

/// A call in progress.
#[derive(Clone, Copy, Debug)]
struct Call {
    watch: usize,
    return_to: u32,
    stack: u32,
    depth: usize,
    instructions: u64,
}

#[derive(Clone, Debug)]
struct Watch {
    name: String,
    entry: u32,
    calls: u64,
    returned: u64,
    instructions: u64,
    longest: u64,
}

impl Watch {
    fn returned(&mut self, instructions: u64) {
        self.returned += 1;
        self.instructions += instructions;
        self.longest = self.longest.max(instructions);
    }
}

/// Watched functions.
#[derive(Clone, Debug, Default)]
pub struct Watches {
    watches: Vec<Watch>,
    running: Vec<Call>,
}

impl Watches {
    /// Watch a function.
    pub fn add(&mut self, name: &str, entry: u32) {
        let watch = Watch { name: name.to_owned(), entry, calls: 0, returned: 0, instructions: 0, longest: 0 };
        self.watches.push(watch);
    }

    /// A watched function starts at `address`.
    pub fn starts_at(&self, address: u32) -> bool {
        self.watches.iter().any(|watch| watch.entry == address)
    }

    /// Some call is in progress.
    pub fn running(&self) -> bool {
        !self.running.is_empty()
    }

    /// A watched function is called.
    pub fn enter(&mut self, address: u32, return_to: u32, stack: u32, depth: usize) {
        for (i, watch) in self.watches.iter_mut().enumerate().filter(|(_, watch)| watch.entry == address) {
            // A loop back to the first instruction is no call.
            let again = self.running.iter().any(|call| call.watch == i && call.stack == stack && call.depth == depth);
            if !again {
                watch.calls += 1;
                self.running.push(Call { watch: i, return_to: return_to & !1, stack, depth, instructions: 0 });
            }
        }
    }

    /// A block runs. `stack` is called only where a call may have returned.
    pub fn block(&mut self, address: u32, instructions: u64, depth: usize, stack: impl Fn() -> u32) {
        let watches = &mut self.watches;
        self.running.retain_mut(|call| {
            if call.depth != depth {
                return true;
            }
            if call.return_to == address && stack() == call.stack {
                watches[call.watch].returned(call.instructions);
                return false;
            }
            call.instructions += instructions;
            true
        });
    }

    /// The core has returned from an exception to `depth`: a watched handler has ended with it.
    pub fn unwind(&mut self, depth: usize) {
        let watches = &mut self.watches;
        self.running.retain(|call| {
            let over = call.depth > depth;
            if over && call.return_to >= EXC_RETURN {
                watches[call.watch].returned(call.instructions);
            }
            !over
        });
    }

    /// The core has been reset: calls in progress never return.
    pub fn reset(&mut self) {
        self.running.clear();
    }

    /// Names and costs in the order of watching.
    pub fn stats(&self) -> impl Iterator<Item = (&str, TickStats)> {
        self.watches.iter().map(|watch| {
            let instructions_mean = watch.instructions as f64 / watch.returned.max(1) as f64;
            let stats = TickStats { count: watch.returned, instructions_mean, instructions_max: watch.longest };
            (watch.name.as_str(), stats)
        })
    }

    /// How often each function has been called, returned or not.
    pub fn call_counts(&self) -> impl Iterator<Item = (&str, u64)> {
        self.watches.iter().map(|watch| (watch.name.as_str(), watch.calls))
    }
}
