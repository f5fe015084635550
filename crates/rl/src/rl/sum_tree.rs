//! Sums of priorities, for draws in proportion to them.

/// Binary tree of partial sums over leaves that are at least 0.
///
/// Every inner node is exactly the rounded sum of its two children, so the tree
/// is a pure function of its leaves.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct SumTree {
    /// Heap order: node i has the children 2i and 2i + 1, and index 0 is unused.
    nodes: Vec<f64>,
}

impl SumTree {
    /// Creates a tree over these leaves.
    pub fn new(leaves: &[f64]) -> SumTree {
        let mut tree = SumTree::default();
        tree.grow(leaves.len());
        let first = tree.capacity();
        tree.nodes[first..first + leaves.len()].copy_from_slice(leaves);
        tree.sum_up();
        tree
    }

    /// Makes room for leaves with index below `leaves`. New leaves are 0.
    pub fn grow(&mut self, leaves: usize) {
        let old = self.capacity();
        let new = leaves.next_power_of_two();
        if old < new {
            let mut nodes = vec![0.0; 2 * new];
            nodes[new..new + old].copy_from_slice(&self.nodes[old..]);
            self.nodes = nodes;
            self.sum_up();
        }
    }

    /// Sets a leaf.
    pub fn set(&mut self, leaf: usize, value: f64) {
        let mut node = self.capacity() + leaf;
        self.nodes[node] = value;
        // Summed anew from both children: adding the difference would accumulate
        // rounding, and the tree would depend on its history.
        while node > 1 {
            node /= 2;
            self.nodes[node] = self.nodes[2 * node] + self.nodes[2 * node + 1];
        }
    }

    /// Returns a leaf.
    pub fn get(&self, leaf: usize) -> f64 {
        self.nodes[self.capacity() + leaf]
    }

    /// Returns the sum of all leaves.
    pub fn total(&self) -> f64 {
        self.nodes.get(1).copied().unwrap_or(0.0)
    }

    /// Sets many leaves. If a leaf is given twice, its last value counts.
    ///
    /// Uses `leaves` up as working memory. Sorted leaves share most of the work.
    pub fn set_all(&mut self, leaves: &mut [usize], values: &[f32]) {
        let first = self.capacity();
        for (leaf, value) in leaves.iter_mut().zip(values) {
            *leaf += first;
            self.nodes[*leaf] = f64::from(*value);
        }
        // Level by level, so that no sum waits for the sum before it. Each level sees
        // complete children, hence the tree is that of single calls of `set`.
        let mut count = leaves.len();
        for _ in 0..self.levels() {
            let (mut kept, mut before) = (0, 0);
            for at in 0..count {
                let node = leaves[at] / 2;
                self.nodes[node] = self.nodes[2 * node] + self.nodes[2 * node + 1];
                // Neighbours with one parent go on as one.
                kept += usize::from(at > 0 && node != before);
                leaves[kept] = node;
                before = node;
            }
            count = (kept + 1).min(count);
        }
    }

    /// Finds, for every mass, the leaf in whose share of the total it lies.
    ///
    /// A leaf of 0 is never found while the total is positive.
    pub fn find(&self, masses: &[f64], leaves: &mut [usize]) {
        // Eight masses descend together. The processor then waits for many nodes at
        // once instead of in sequence.
        const TOGETHER: usize = 8;
        let (masses, last_masses) = masses.as_chunks::<TOGETHER>();
        let (leaves, last_leaves) = leaves.as_chunks_mut::<TOGETHER>();
        for (masses, leaves) in masses.iter().zip(leaves) {
            *leaves = self.descend(*masses);
        }
        for (mass, leaf) in last_masses.iter().zip(last_leaves) {
            [*leaf] = self.descend([*mass]);
        }
    }

    #[inline(always)]
    fn descend<const N: usize>(&self, mut masses: [f64; N]) -> [usize; N] {
        let (children, _) = self.nodes.as_chunks::<2>();
        let mut nodes = [1; N];
        for _ in 0..self.levels() {
            for (mass, node) in masses.iter_mut().zip(&mut nodes) {
                let [left, right] = children[*node];
                // Rounding may leave the mass at the very end. The walk then stays on the
                // side with positive leaves.
                let goes_right = (left <= *mass) & (right > 0.0);
                // A product, since the compiler turns every choice between two numbers into
                // a branch, which would be mispredicted half of the time.
                *mass -= left * f64::from(u8::from(goes_right));
                *node = 2 * *node + usize::from(goes_right);
            }
        }
        nodes.map(|node| node - self.capacity())
    }

    /// Returns the number of levels above the leaves.
    fn levels(&self) -> u32 {
        // An empty tree has no level: 0 has all zeros at its end.
        self.capacity().max(1).trailing_zeros()
    }

    fn capacity(&self) -> usize {
        self.nodes.len() / 2
    }

    fn sum_up(&mut self) {
        for node in (1..self.capacity()).rev() {
            self.nodes[node] = self.nodes[2 * node] + self.nodes[2 * node + 1];
        }
    }
}
