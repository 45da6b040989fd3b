//! Emulated time: a count of HCLK cycles, and what it means in seconds.
//!
//! Cycles are the only unit in which peripherals schedule anything. When the firmware changes the clock tree the
//! relation between cycles and seconds gets a new origin, so that seconds never jump.

/// A cycle that never comes.
pub const NEVER: u64 = u64::MAX;

/// Clock frequencies as the RCC registers select them (RM0390 section 6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockTree {
    /// HCLK in hertz.
    pub hclk_hz: u64,
    /// HCLK cycles in a PCLK1 cycle.
    pub apb1_divider: u64,
    /// HCLK cycles in a PCLK2 cycle.
    pub apb2_divider: u64,
}

impl ClockTree {
    /// What the chip runs on after a reset: HSI, nothing divided.
    pub const RESET: Self = Self { hclk_hz: 16_000_000, apb1_divider: 1, apb2_divider: 1 };
}

/// The emulated clock.
#[derive(Clone, Debug)]
pub struct Clock {
    now: u64,
    tree: ClockTree,
    base_cycles: u64,
    base_s: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { now: 0, tree: ClockTree::RESET, base_cycles: 0, base_s: 0.0 }
    }
}

impl Clock {
    /// Cycles since power-up.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// Let `cycles` pass.
    pub fn advance(&mut self, cycles: u64) {
        self.now += cycles;
    }

    /// Let time pass until `cycle`, if that is in the future.
    pub fn advance_to(&mut self, cycle: u64) {
        self.now = self.now.max(cycle);
    }

    /// Seconds since power-up.
    pub fn seconds(&self) -> f64 {
        self.seconds_at(self.now)
    }

    /// Seconds since power-up at `cycle`.
    pub fn seconds_at(&self, cycle: u64) -> f64 {
        self.base_s + (cycle as f64 - self.base_cycles as f64) / self.tree.hclk_hz as f64
    }

    /// The first cycle that is not before `t_s`.
    pub fn cycle_at(&self, t_s: f64) -> u64 {
        // A thousandth of a cycle of slack: t_s is often itself computed from a cycle count, and rounding must not push
        // it up.
        let cycles = ((t_s - self.base_s) * self.tree.hclk_hz as f64 - 1e-3).ceil();
        self.base_cycles.saturating_add(cycles.max(0.0) as u64)
    }

    /// Cycles in a span of seconds.
    pub fn span(&self, seconds: f64) -> u64 {
        (seconds * self.tree.hclk_hz as f64).round() as u64
    }

    /// The frequencies in force.
    pub fn tree(&self) -> ClockTree {
        self.tree
    }

    /// HCLK cycles in a cycle of the peripheral bus.
    pub fn apb_divider(&self, apb2: bool) -> u64 {
        if apb2 { self.tree.apb2_divider } else { self.tree.apb1_divider }
    }

    /// HCLK cycles in a cycle of the timers' clock: PCLK, doubled where the bus is divided.
    pub fn timer_divider(&self, apb2: bool) -> u64 {
        (self.apb_divider(apb2) / 2).max(1)
    }

    /// Run on other frequencies from now on.
    pub fn retune(&mut self, tree: ClockTree) {
        self.base_s = self.seconds();
        self.base_cycles = self.now;
        self.tree = tree;
    }
}
