use glam::DVec3;

/// A triangle of PV or a part of one: each splits into four of a quarter of the area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub corners: [DVec3; 3],
    /// Halvings since the whole triangle.
    pub level: u32,
    /// Number among the cells of its level; its four parts are `4 index ..`.
    pub index: usize,
    /// Corners on the triangle's lattice of `2^asked` steps along each edge; without meaning below
    /// the asked level.
    pub nodes: [[u16; 2]; 3],
}

impl Cell {
    /// A whole triangle whose cells `asked` levels down lie between the nodes of its lattice.
    pub(super) fn whole(corners: [DVec3; 3], asked: u32) -> Self {
        let n = 1 << asked;
        Self { corners, level: 0, index: 0, nodes: [[0, 0], [n, 0], [0, n]] }
    }

    pub(super) fn parts(&self) -> [Self; 4] {
        let [a, b, c] = self.corners;
        let (ab, bc, ca) = ((a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5);
        let [i, j, k] = self.nodes;
        let half = |p: [u16; 2], q: [u16; 2]| [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2];
        let (ij, jk, ki) = (half(i, j), half(j, k), half(k, i));
        let part = |part, corners, nodes| Self {
            corners,
            level: self.level + 1,
            index: 4 * self.index + part,
            nodes,
        };
        [
            part(0, [a, ab, ca], [i, ij, ki]),
            part(1, [ab, b, bc], [ij, j, jk]),
            part(2, [ca, bc, c], [ki, jk, k]),
            part(3, [ab, bc, ca], [ij, jk, ki]),
        ]
    }

    pub(super) fn middle(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (a + b + c) / 3.0
    }

    pub(super) fn area_m2(&self) -> f64 {
        let [a, b, c] = self.corners;
        0.5 * (b - a).cross(c - a).length()
    }

    /// The cells some levels further down, in their order.
    pub(super) fn below(&self, levels: u32) -> Vec<Self> {
        let mut cells = vec![*self];
        for _ in 0..levels {
            cells = cells.iter().flat_map(Self::parts).collect();
        }
        cells
    }
}

/// The lattice over a triangle between whose nodes the asked cells lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lattice {
    corners: [DVec3; 3],
    /// Steps along each edge.
    steps: usize,
}

impl Lattice {
    pub(super) fn new(corners: [DVec3; 3], asked: u32) -> Self {
        Self { corners, steps: 1 << asked }
    }

    pub(super) fn len(&self) -> usize {
        (self.steps + 1) * (self.steps + 2) / 2
    }

    /// Number of a node.
    #[inline]
    pub(super) fn number(&self, [i, j]: [u16; 2]) -> usize {
        let (i, j) = (usize::from(i), usize::from(j));
        // Rows of steps + 1, steps, .. nodes.
        j * (self.steps + 1) - j * j.saturating_sub(1) / 2 + i
    }

    /// All nodes in the order of their numbers.
    pub(super) fn nodes(&self) -> Vec<[u16; 2]> {
        let steps = self.steps as u16;
        (0..=steps).flat_map(|j| (0..=steps - j).map(move |i| [i, j])).collect()
    }

    /// Where a node's question is asked: a little inside of the triangle, so that what stands at
    /// its very edge doesn't decide by a rounding.
    pub(super) fn place(&self, [i, j]: [u16; 2]) -> DVec3 {
        let [a, b, c] = self.corners;
        let n = self.steps as f64;
        let at = a + (b - a) * (f64::from(i) / n) + (c - a) * (f64::from(j) / n);
        let middle = (a + b + c) / 3.0;
        middle + (at - middle) * (1.0 - 0.1 / n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_lie_between_the_nodes_of_the_lattice() {
        let corners = [DVec3::ZERO, DVec3::X * 8.0, DVec3::new(1.0, 6.0, 2.0)];
        let asked = 3;
        let lattice = Lattice::new(corners, asked);
        let nodes = lattice.nodes();
        assert_eq!(nodes.len(), lattice.len());
        for (i, node) in nodes.iter().enumerate() {
            assert_eq!(lattice.number(*node), i);
        }
        let cells = Cell::whole(corners, asked).below(asked);
        assert_eq!(cells.len(), 64);
        let mut area_m2 = 0.0;
        for (i, cell) in cells.iter().enumerate() {
            assert_eq!(cell.index, i);
            area_m2 += cell.area_m2();
            for (corner, node) in cell.corners.iter().zip(cell.nodes) {
                assert!(corner.distance(lattice.place(node)) < 0.15);
            }
        }
        assert!((area_m2 - cells[0].area_m2() * 64.0).abs() < 1e-9);
    }
}
