//! Matrix products for small networks, with a fixed order of additions.
//!
//! Every sum runs over the shared index from first to last, product by product,
//! without fused multiply-add. Only independent sums share a vector register. A
//! result therefore depends neither on its batch nor on the width of the
//! registers. Acting and training agree to the last bit, on every CPU.

use pulp::{Arch, Simd, WithSimd};

/// Multiple of stored columns. The padding contains zeros.
pub(crate) const LANES: usize = 8;

/// Rows of a result that are computed together.
const ROWS: usize = 4;

/// Rounds a number of columns up to a multiple of [`LANES`].
pub(crate) const fn padded(columns: usize) -> usize {
    columns.next_multiple_of(LANES)
}

/// Product `start + left · right`, written row by row.
///
/// Element (i, p) of the left factor is `left[i * row + p * column]`. Exchange
/// the two strides for its transpose. `right` is `[depth, width]`, dense.
/// `start` is `[width]`. `width` is a multiple of [`LANES`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Product<'a> {
    /// Numbers of the left factor.
    pub(crate) left: &'a [f32],
    /// Distance between rows of the left factor.
    pub(crate) row: usize,
    /// Distance between columns of the left factor.
    pub(crate) column: usize,
    /// Numbers of the right factor.
    pub(crate) right: &'a [f32],
    /// Start of every row of the sum: the bias, or zeros.
    pub(crate) start: &'a [f32],
}

impl Product<'_> {
    /// Fills `out`, `[rows, width]`, dense.
    ///
    /// The code is compiled for several instruction sets and chosen at run time. All
    /// of them give the same bits.
    pub(crate) fn write(&self, out: &mut [f32]) {
        Arch::new().dispatch(Write {
            product: *self,
            out,
        });
    }

    #[inline(always)]
    fn strips(&self, out: &mut [f32]) {
        let width = self.start.len();
        // Invariant: columns are padded, so that no tile exceeds the edge.
        assert!(width.is_multiple_of(LANES) && out.len().is_multiple_of(width));
        let mut strips = out.chunks_exact_mut(ROWS * width);
        let mut row = 0;
        for strip in &mut strips {
            self.strip::<ROWS>(row, width, strip);
            row += ROWS;
        }
        // Rows that do not fill a strip are computed singly, in the same order of
        // additions, so their bits are the same.
        for strip in strips.into_remainder().chunks_exact_mut(width) {
            self.strip::<1>(row, width, strip);
            row += 1;
        }
    }

    #[inline(always)]
    fn strip<const R: usize>(&self, row: usize, width: usize, out: &mut [f32]) {
        let mut column = 0;
        while column + 2 * LANES <= width {
            self.tile::<R, { 2 * LANES }>(row, column, width, out);
            column += 2 * LANES;
        }
        // At most one narrow tile remains, since the width is a multiple of LANES.
        if column < width {
            self.tile::<R, LANES>(row, column, width, out);
        }
    }

    #[inline(always)]
    fn tile<const R: usize, const C: usize>(
        &self,
        row: usize,
        column: usize,
        width: usize,
        out: &mut [f32],
    ) {
        let mut start = [0.0f32; C];
        start.copy_from_slice(&self.start[column..column + C]);
        let sums = self.sums::<R, C>(row, column, width, [start; R]);
        for (sum, out) in sums.iter().zip(out.chunks_exact_mut(width)) {
            out[column..column + C].copy_from_slice(sum);
        }
    }

    /// Sums R rows by C columns of the result in registers while p runs.
    #[inline(always)]
    fn sums<const R: usize, const C: usize>(
        &self,
        row: usize,
        column: usize,
        width: usize,
        mut sums: [[f32; C]; R],
    ) -> [[f32; C]; R] {
        for (p, right) in self.right.chunks_exact(width).enumerate() {
            let Some(right) = right
                .get(column..)
                .and_then(|right| right.first_chunk::<C>())
            else {
                // Invariant: tiles end within the width, so no product is ever left out.
                return sums;
            };
            for (r, sums) in sums.iter_mut().enumerate() {
                let left = self.left[(row + r) * self.row + p * self.column];
                for (sum, right) in sums.iter_mut().zip(right) {
                    // Rust never fuses this into a multiply-add, so all CPUs round alike.
                    *sum += left * right;
                }
            }
        }
        sums
    }
}

/// Work item for [`Arch::dispatch`].
struct Write<'a> {
    product: Product<'a>,
    out: &'a mut [f32],
}

impl WithSimd for Write<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.product.strips(self.out);
    }
}
