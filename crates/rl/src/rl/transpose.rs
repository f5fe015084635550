//! Transposes of small matrices.
//!
//! A compiler moves the numbers one by one. Shuffles of registers move eight at a
//! time, on x86-64 processors with AVX.

use super::kernel::LANES;

/// Writes the transpose of `matrix`, `[rows, width]`, dense.
///
/// Column c of the matrix begins at `out[c * stride]`. `width` is a multiple of
/// [`LANES`], and `stride` is at least the number of rows.
pub fn transpose(matrix: &[f32], width: usize, out: &mut [f32], stride: usize) {
    // Invariant: columns are padded, so that no block exceeds the edge.
    assert!(width.is_multiple_of(LANES) && matrix.len().is_multiple_of(width));
    let blocks = matrix.chunks_exact(LANES * width);
    let (last, first) = (blocks.remainder(), matrix.len() / (LANES * width) * LANES);
    turn_blocks(Blocks {
        matrix,
        width,
        out,
        stride,
    });
    // The last rows fill no block and are moved one by one.
    for (row, values) in last.chunks_exact(width).enumerate() {
        for (column, value) in values.iter().enumerate() {
            out[column * stride + first + row] = *value;
        }
    }
}

/// Square block of a matrix.
type Block = [[f32; LANES]; LANES];

/// Rows of a matrix in full blocks, and the place of their transpose.
struct Blocks<'a> {
    matrix: &'a [f32],
    width: usize,
    out: &'a mut [f32],
    stride: usize,
}

impl Blocks<'_> {
    #[inline(always)]
    fn turn(self, turn: impl Fn(Block) -> Block) {
        let strips = self.matrix.chunks_exact(LANES * self.width);
        for (strip, rows) in strips.enumerate() {
            for column in (0..self.width).step_by(LANES) {
                let row = |r: usize| {
                    let at = r * self.width + column;
                    let mut row = [0.0; LANES];
                    row.copy_from_slice(&rows[at..at + LANES]);
                    row
                };
                let turned = turn(std::array::from_fn(row));
                for (c, values) in turned.iter().enumerate() {
                    let at = (column + c) * self.stride + strip * LANES;
                    self.out[at..at + LANES].copy_from_slice(values);
                }
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn turn_blocks(blocks: Blocks) {
    use pulp::Simd;
    use pulp::x86::V3;

    struct Shuffled<'a> {
        simd: V3,
        blocks: Blocks<'a>,
    }

    impl pulp::NullaryFnOnce for Shuffled<'_> {
        type Output = ();

        #[inline(always)]
        fn call(self) {
            let simd = self.simd;
            self.blocks.turn(
                #[inline(always)]
                |block| shuffle(simd, block),
            );
        }
    }

    match V3::try_new() {
        // Asked for at run time, so that one binary runs on every x86-64 machine.
        Some(simd) => Simd::vectorize(simd, Shuffled { simd, blocks }),
        None => blocks.turn(turn),
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn turn_blocks(blocks: Blocks) {
    blocks.turn(turn);
}

#[inline(always)]
fn turn(block: Block) -> Block {
    std::array::from_fn(|c| std::array::from_fn(|r| block[r][c]))
}

/// Transposes a block: first pairs of numbers, then pairs of pairs, then halves.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn shuffle(simd: pulp::x86::V3, block: Block) -> Block {
    use std::arch::x86_64::__m256;

    let avx = simd.avx;
    let r: [__m256; LANES] = block.map(pulp::cast);
    let low = |i: usize| avx._mm256_unpacklo_ps(r[i], r[i + 1]);
    let high = |i: usize| avx._mm256_unpackhi_ps(r[i], r[i + 1]);
    // Three stages of eight shuffles: pairs, then quadruples, then halves of registers.
    let t = [
        [low(0), low(2)],
        [high(0), high(2)],
        [low(4), low(6)],
        [high(4), high(6)],
    ];
    let front = |i: usize| avx._mm256_shuffle_ps::<0x44>(t[i][0], t[i][1]);
    let back = |i: usize| avx._mm256_shuffle_ps::<0xee>(t[i][0], t[i][1]);
    let upper = [front(0), back(0), front(1), back(1)];
    let lower = [front(2), back(2), front(3), back(3)];
    let left = |i: usize| avx._mm256_permute2f128_ps::<0x20>(upper[i], lower[i]);
    let right = |i: usize| avx._mm256_permute2f128_ps::<0x31>(upper[i], lower[i]);
    let columns = [
        left(0),
        left(1),
        left(2),
        left(3),
        right(0),
        right(1),
        right(2),
        right(3),
    ];
    columns.map(pulp::cast)
}

#[cfg(test)]
mod tests {
    use super::transpose;

    #[test]
    fn every_number_moves_to_its_column() {
        for (rows, width, stride) in [(8, 8, 8), (3, 8, 5), (13, 24, 16), (64, 64, 64), (0, 8, 1)] {
            let matrix: Vec<f32> = (0..rows * width).map(|i| 1.0 + i as f32).collect();
            let mut out = vec![0.0; width * stride];
            transpose(&matrix, width, &mut out, stride);
            for (at, value) in out.iter().enumerate() {
                let (column, row) = (at / stride, at % stride);
                let expected = if row < rows {
                    matrix[row * width + column]
                } else {
                    0.0
                };
                assert_eq!(
                    *value, expected,
                    "row {row}, column {column} of {rows} x {width}"
                );
            }
        }
    }
}
