//! Lines of equal value of a field that is known at the nodes of a grid.

/// Values at the nodes of a grid; NaN where there is none.
#[derive(Debug, Clone)]
pub struct Field<'a> {
    /// Positions across, rising.
    pub x: &'a [f64],
    /// Positions up, rising.
    pub y: &'a [f64],
    /// One value for each node, x slowest.
    pub values: &'a [f64],
}

/// Lines on which the field has this value, linear between nodes; none where a corner has no value.
pub fn lines(field: &Field<'_>, level: f64) -> Vec<Vec<(f64, f64)>> {
    let mut left = pieces(field, level);
    let mut lines = Vec::new();
    while let Some([a, b]) = left.pop() {
        let mut line = std::collections::VecDeque::from([a, b]);
        // Neighbours find the same point on their common edge, to the last bit.
        while let Some((k, next, at_end)) = left.iter().enumerate().find_map(|(k, [p, q])| {
            let (first, last) = (line.front()?, line.back()?);
            let joins =
                [(last == p, *q, true), (last == q, *p, true), (first == p, *q, false), (first == q, *p, false)];
            joins.into_iter().find(|j| j.0).map(|(_, next, at_end)| (k, next, at_end))
        }) {
            left.swap_remove(k);
            if at_end { line.push_back(next) } else { line.push_front(next) }
        }
        lines.push(line.into());
    }
    lines
}

fn pieces(field: &Field<'_>, level: f64) -> Vec<[(f64, f64); 2]> {
    let Field { x, y, values } = field;
    let node = |i: usize, j: usize| ((x[i], y[j]), values[i * y.len() + j] - level);
    let mut pieces = Vec::new();
    for i in 1..x.len() {
        for j in 1..y.len() {
            let corners = [node(i - 1, j - 1), node(i, j - 1), node(i, j), node(i - 1, j)];
            if corners.iter().any(|(_, v)| !v.is_finite()) {
                continue;
            }
            let mut crossed = (0..4).filter_map(|k| crossing(corners[k], corners[(k + 1) % 4]));
            // A saddle gives two pieces.
            while let (Some(a), Some(b)) = (crossed.next(), crossed.next()) {
                pieces.push([a, b]);
            }
        }
    }
    pieces
}

/// Where the value vanishes between two nodes.
fn crossing(one: ((f64, f64), f64), other: ((f64, f64), f64)) -> Option<(f64, f64)> {
    // The same way round from both sides of an edge.
    let ((a, va), (b, vb)) = if one.0 <= other.0 { (one, other) } else { (other, one) };
    let fraction = va / (va - vb);
    ((va > 0.0) != (vb > 0.0)).then_some((a.0 + fraction * (b.0 - a.0), a.1 + fraction * (b.1 - a.1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_of_a_plane_is_straight_and_stops_where_nothing_is_known() {
        let (x, y) = ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0]);
        let mut values: Vec<f64> = x.iter().flat_map(|x| y.iter().map(move |y| x + 2.0 * y)).collect();
        let whole = lines(&Field { x: &x, y: &y, values: &values }, 1.5);
        assert_eq!(whole.len(), 1, "{whole:?}");
        for (x, y) in whole.iter().flatten() {
            assert!((x + 2.0 * y - 1.5).abs() < 1e-12);
        }
        values[0] = f64::NAN;
        let rest = lines(&Field { x: &x, y: &y, values: &values }, 1.5).concat();
        assert!(rest.len() < whole[0].len());
        assert!(lines(&Field { x: &x, y: &y, values: &values }, 50.0).is_empty());
    }
}
