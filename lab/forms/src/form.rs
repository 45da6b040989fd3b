//! The forms, with value and gradient in coordinates on [−1, 1]².

/// Value and derivatives at a position (x along the load axis, y along the twist axis).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// G (m).
    pub value: f32,
    /// ∂G/∂x.
    pub by_x: f32,
    /// ∂G/∂y.
    pub by_y: f32,
}

impl Value {
    /// What inconsistent numbers give.
    const NONE: Self = Self { value: f32::NAN, by_x: f32::NAN, by_y: f32::NAN };
}

/// Maximum rows of a series.
pub const MAX_ROWS: usize = 30;

/// What a table's numbers mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Σ_i x^i Σ_j c_ij y^j: a Chebyshev series, cut row by row where its terms become negligible, written in powers.
    /// Rows descend in i, coefficients within a row in j: in the order in which Horner needs them.
    Series {
        /// How many rows.
        rows: u8,
        /// Coefficients in each row.
        row_lengths: [u8; MAX_ROWS],
    },
    /// Bicubic Hermite patches on a uniform grid: at every node G, h_x ∂G/∂x, h_y ∂G/∂y, h_x h_y ∂²G/∂x∂y, load index
    /// slowest.
    Hermite {
        /// Nodes along the load axis.
        loads: u16,
        /// Nodes along the twist axis.
        twists: u16,
    },
    /// Piecewise bilinear on a uniform grid of G (m), load index slowest.
    Bilinear {
        /// Nodes along the load axis.
        loads: u16,
        /// Nodes along the twist axis.
        twists: u16,
    },
}

impl Form {
    /// Its name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Series { .. } => "chebyshev-series",
            Self::Hermite { .. } => "hermite-bicubic",
            Self::Bilinear { .. } => "bilinear",
        }
    }

    /// Value and gradient at a position.
    #[inline]
    pub(crate) fn evaluate(&self, numbers: &[f32], x: f32, y: f32) -> Value {
        match self {
            Self::Series { rows, row_lengths } => {
                row_lengths.get(..usize::from(*rows)).map_or(Value::NONE, |rows| series(rows, numbers, x, y))
            }
            Self::Hermite { loads, twists } => {
                hermite(usize::from(*loads), usize::from(*twists), numbers.as_chunks().0, x, y)
            }
            Self::Bilinear { loads, twists } => bilinear(usize::from(*loads), usize::from(*twists), numbers, x, y),
        }
    }
}

/// Value and slope along one row by Horner's rule, the highest power first.
#[inline(always)]
fn along(row: &[f32], y: f32, (mut value, mut slope): (f32, f32)) -> (f32, f32) {
    for c in row {
        slope = slope * y + value;
        value = value * y + c;
    }
    (value, slope)
}

/// Maximum coefficients of a row that are evaluated without a loop.
const STRAIGHT: usize = 8;

/// Value and slope of the row of `length` coefficients at the start of `rest`, and the coefficients after it.
///
/// There is one arm for each length, so that each is unrolled without counting or checking: this is most of a lookup.
#[inline(always)]
fn row(length: usize, rest: &[f32], y: f32) -> Option<((f32, f32), &[f32])> {
    let (mut sum, mut left, mut rest) = ((0.0, 0.0), length, rest);
    while left > STRAIGHT {
        let (head, tail) = rest.split_first_chunk::<STRAIGHT>()?;
        sum = along(head, y, sum);
        (rest, left) = (tail, left - STRAIGHT);
    }
    macro_rules! straight {
        ($n:literal) => {{
            let (head, tail) = rest.split_first_chunk::<$n>()?;
            (along(head, y, sum), tail)
        }};
    }
    Some(match left {
        1 => straight!(1),
        2 => straight!(2),
        3 => straight!(3),
        4 => straight!(4),
        5 => straight!(5),
        6 => straight!(6),
        7 => straight!(7),
        _ => straight!(8),
    })
}

/// Horner's rule in y along each row and in x across the rows, both from the highest power down. Lengths that do not
/// fit the coefficients give NaN.
#[inline(never)]
fn series(row_lengths: &[u8], coefficients: &[f32], x: f32, y: f32) -> Value {
    let mut total = Value { value: 0.0, by_x: 0.0, by_y: 0.0 };
    let mut rest = coefficients;
    for length in row_lengths {
        let Some(((value, slope), after)) = row(usize::from(*length), rest, y) else {
            return Value::NONE;
        };
        rest = after;
        total.by_x = total.by_x * x + total.value;
        total.value = total.value * x + value;
        total.by_y = total.by_y * x + slope;
    }
    total
}

/// Cell index and position within the cell, 0 to 1, of a grid of `count` nodes on [−1, 1].
#[inline]
fn cell(position: f32, count: usize) -> (usize, f32, f32) {
    let cells = (count - 1) as f32;
    let at = (position + 1.0) * 0.5 * cells;
    let index = (at.max(0.0) as usize).min(count - 2);
    (index, at - index as f32, 0.5 * cells)
}

/// Cubic Hermite basis and its derivative: weights of value, slope at both ends.
#[inline]
fn basis(t: f32) -> ([f32; 4], [f32; 4]) {
    let u = 1.0 - t;
    (
        [u * u * (1.0 + 2.0 * t), t * u * u, t * t * (3.0 - 2.0 * t), -t * t * u],
        [-6.0 * t * u, u * (1.0 - 3.0 * t), 6.0 * t * u, t * (3.0 * t - 2.0)],
    )
}

fn hermite(loads: usize, twists: usize, nodes: &[[f32; 4]], x: f32, y: f32) -> Value {
    let ((i, s, x_scale), (j, t, y_scale)) = (cell(x, loads), cell(y, twists));
    let ((bx, dx), (by, dy)) = (basis(s), basis(t));
    let mut total = Value { value: 0.0, by_x: 0.0, by_y: 0.0 };
    for a in 0..2 {
        for b in 0..2 {
            let Some([g, gx, gy, gxy]) = nodes.get((i + a) * twists + j + b) else { continue };
            let along = |w: &[f32; 4]| (w[2 * b] * g + w[2 * b + 1] * gy, w[2 * b] * gx + w[2 * b + 1] * gxy);
            let (value, slope) = along(&by);
            total.value += bx[2 * a] * value + bx[2 * a + 1] * slope;
            total.by_x += dx[2 * a] * value + dx[2 * a + 1] * slope;
            let (value, slope) = along(&dy);
            total.by_y += bx[2 * a] * value + bx[2 * a + 1] * slope;
        }
    }
    Value { value: total.value, by_x: total.by_x * x_scale, by_y: total.by_y * y_scale }
}

fn bilinear(loads: usize, twists: usize, nodes: &[f32], x: f32, y: f32) -> Value {
    let ((i, s, x_scale), (j, t, y_scale)) = (cell(x, loads), cell(y, twists));
    let node = |a: usize, b: usize| nodes.get((i + a) * twists + j + b).copied().unwrap_or(0.0);
    let (g00, g01, g10, g11) = (node(0, 0), node(0, 1), node(1, 0), node(1, 1));
    let (low, high) = (g00 + t * (g01 - g00), g10 + t * (g11 - g10));
    Value {
        value: low + s * (high - low),
        by_x: (high - low) * x_scale,
        by_y: ((g01 - g00) * (1.0 - s) + (g11 - g10) * s) * y_scale,
    }
}
