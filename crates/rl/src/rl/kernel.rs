//! Matrix products for small networks, with a fixed order of additions.
//!
//! Every sum runs over the shared index from first to last, product by product,
//! without fused multiply-add. Only independent sums share a vector register. A
//! result therefore depends neither on its batch nor on the width of the
//! registers. Acting and training agree to the last bit, on every CPU.

use pulp::{Arch, Simd, WithSimd};

/// Multiple of stored columns. The padding contains zeros.
pub const LANES: usize = 8;

/// Rows of a result that are computed together.
const ROWS: usize = 4;

/// Rows computed together if a row is a single narrow tile and registers are many.
const NARROW_ROWS: usize = 8;

/// Rounds a number of columns up to a multiple of [`LANES`].
pub(crate) const fn padded(columns: usize) -> usize {
    columns.next_multiple_of(LANES)
}

/// Loop over numbers that share registers, compiled for several instruction sets.
pub(crate) trait Loop: Sized {
    /// Result of the loop.
    type Output;

    /// Runs the loop. Mark it `#[inline(always)]`, or it is compiled for the narrowest
    /// registers only.
    fn run(self) -> Self::Output;

    /// Runs the loop with the widest registers of this processor.
    ///
    /// All widths give the same bits.
    fn vectorized(self) -> Self::Output {
        Arch::new().dispatch(Run(self))
    }
}

/// Work item of [`Loop::vectorized`].
struct Run<L>(L);

impl<L: Loop> WithSimd for Run<L> {
    type Output = L::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> L::Output {
        self.0.run()
    }
}

/// Product `start + left · right`, written row by row.
///
/// Element (i, p) of the left factor is `left[i * row + p * column]`. Exchange
/// the two strides for its transpose. `right` is `[depth, width]`, dense.
/// `start` is `[width]`. `width` is a multiple of [`LANES`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Product<'a> {
    /// Numbers of the left factor.
    pub left: &'a [f32],
    /// Distance between rows of the left factor.
    pub row: usize,
    /// Distance between columns of the left factor.
    pub column: usize,
    /// Numbers of the right factor.
    pub right: &'a [f32],
    /// Start of every row of the sum: the bias, or zeros.
    pub start: &'a [f32],
}

impl Product<'_> {
    /// Fills `out`, `[rows, width]`, dense.
    ///
    /// The code is compiled for several instruction sets and chosen at run time. All
    /// of them give the same bits.
    pub fn write(&self, out: &mut [f32]) {
        Arch::new().dispatch(Write {
            product: *self,
            out,
        });
    }

    #[inline(always)]
    fn strips<S: Simd>(&self, simd: S, out: &mut [f32]) {
        let width = self.start.len();
        // Invariant: columns are padded, so that no tile exceeds the edge.
        assert!(width.is_multiple_of(LANES) && out.len().is_multiple_of(width));
        // A narrow row is one register, and 32 registers hold more than four of them.
        let (rows, rest) = if width == LANES && S::F32_LANES == 16 {
            self.strips_of::<S, NARROW_ROWS>(simd, 0, width, out)
        } else {
            self.strips_of::<S, ROWS>(simd, 0, width, out)
        };
        // Rows that do not fill a strip are computed singly, in the same order of
        // additions, so their bits are the same.
        self.strips_of::<S, 1>(simd, rows, width, rest);
    }

    /// Writes full strips of R rows, and returns the next row and the rest.
    #[inline(always)]
    fn strips_of<'a, S: Simd, const R: usize>(
        &self,
        simd: S,
        mut row: usize,
        width: usize,
        out: &'a mut [f32],
    ) -> (usize, &'a mut [f32]) {
        let mut strips = out.chunks_exact_mut(R * width);
        for strip in &mut strips {
            self.strip::<S, R>(simd, row, width, strip);
            row += R;
        }
        (row, strips.into_remainder())
    }

    #[inline(always)]
    fn strip<S: Simd, const R: usize>(&self, simd: S, row: usize, width: usize, out: &mut [f32]) {
        let mut column = 0;
        // Tiles that fill the registers: 512 bits wide, or a single row of 256 bits.
        if S::F32_LANES == 16 {
            column = self.wide_tiles::<S, R, 4>(simd, row, column, width, out);
            column = self.wide_tiles::<S, R, 2>(simd, row, column, width, out);
        } else if S::F32_LANES == 8 && R == 1 {
            column = self.wide_tiles::<S, R, 8>(simd, row, column, width, out);
        }
        while column + 2 * LANES <= width {
            self.tile::<R, { 2 * LANES }>(row, column, width, out);
            column += 2 * LANES;
        }
        // At most one narrow tile remains, since the width is a multiple of LANES.
        if column < width {
            self.tile::<R, LANES>(row, column, width, out);
        }
    }

    /// Writes tiles of R rows by C registers while they fit, and returns the next column.
    #[inline(always)]
    fn wide_tiles<S: Simd, const R: usize, const C: usize>(
        &self,
        simd: S,
        row: usize,
        mut column: usize,
        width: usize,
        out: &mut [f32],
    ) -> usize {
        let columns = C * S::F32_LANES;
        while column + columns <= width {
            let sums = self.wide_sums::<S, R, C>(simd, row, column, width);
            for (sums, out) in sums.iter().zip(out.chunks_exact_mut(width)) {
                let (out, _) = S::as_mut_simd_f32s(&mut out[column..column + columns]);
                out.copy_from_slice(sums);
            }
            column += columns;
        }
        column
    }

    /// Sums R rows by C registers of the result while p runs, as [`Product::sums`] does.
    #[inline(always)]
    fn wide_sums<S: Simd, const R: usize, const C: usize>(
        &self,
        simd: S,
        row: usize,
        column: usize,
        width: usize,
    ) -> [[S::f32s; C]; R] {
        let columns = column..column + C * S::F32_LANES;
        let (start, _) = S::as_simd_f32s(&self.start[columns.clone()]);
        let start: [S::f32s; C] = std::array::from_fn(|c| start[c]);
        let mut sums = [start; R];
        for (p, right) in self.right.chunks_exact(width).enumerate() {
            let (right, _) = S::as_simd_f32s(&right[columns.clone()]);
            let right: [S::f32s; C] = std::array::from_fn(|c| right[c]);
            for (r, sums) in sums.iter_mut().enumerate() {
                let left = simd.splat_f32s(self.left[(row + r) * self.row + p * self.column]);
                for (sum, right) in sums.iter_mut().zip(right) {
                    // Two instructions, never a fused one: all CPUs round alike.
                    *sum = simd.add_f32s(*sum, simd.mul_f32s(left, right));
                }
            }
        }
        sums
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
    fn with_simd<S: Simd>(self, simd: S) {
        self.product.strips(simd, self.out);
    }
}
