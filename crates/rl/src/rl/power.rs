//! Powers of many numbers at once, with the bits of `libm::powf`.
//!
//! `libm::powf` (FreeBSD's `e_powf.c`) branches on special cases, so a compiler
//! cannot compute several powers in one register. For positive numbers and
//! exponents in (−1, 1) hardly any branch remains. [`power`] is the rest of it,
//! operation by operation, and every other case calls `libm::powf`.

use super::kernel::Loop;

/// Raises all numbers to a power, with the bits of `libm::powf`.
pub(super) fn powers(values: &mut [f32], exponent: f32) {
    let is_plain = exponent.abs() < 1.0 && exponent.abs() > 1e-6 && exponent != 0.5;
    if is_plain && AreUsual(values).vectorized() {
        PlainPowers { values, exponent }.vectorized();
    } else {
        let power = |x: &mut f32| *x = libm::powf(*x, exponent);
        values.iter_mut().for_each(power);
    }
}

/// True if no power overflows or is subnormal.
struct AreUsual<'a>(&'a [f32]);

impl Loop for AreUsual<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        // Not `all`: without an early exit the comparisons share registers.
        let both = |usual, value: &f32| usual & (*value > 1e-30) & (*value < 1e30);
        self.0.iter().fold(true, both)
    }
}

struct PlainPowers<'a> {
    values: &'a mut [f32],
    exponent: f32,
}

impl Loop for PlainPowers<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for value in self.values {
            *value = power(*value, self.exponent);
        }
    }
}

/// Clears the low bits of a number, so that products of such numbers are exact.
#[inline(always)]
fn high(x: f32) -> f32 {
    f32::from_bits(x.to_bits() & 0xffff_f000)
}

/// Returns x^y = 2^(y log₂ x), each factor as the sum of two numbers.
///
/// Names and constants are those of `e_powf.c`.
#[inline(always)]
fn power(x: f32, y: f32) -> f32 {
    let (t1, t2) = log2(x);
    // (y1 + y2)(t1 + t2)
    let y1 = high(y);
    let p_l = (y - y1) * t1 + y * t2;
    let p_h = y1 * t1;
    exp2(p_h, p_l)
}

/// Returns log₂ x as the sum of a short and a small number.
#[inline(always)]
fn log2(x: f32) -> (f32, f32) {
    const L: [f32; 6] = [
        0.6, 0.42857143, 0.33333334, 0.27272812, 0.23066075, 0.20697501,
    ];
    // 2 / (3 ln 2), its first twelve bits, and the rest.
    const CP: f32 = 0.9617967;
    const CP_H: f32 = 0.96191406;
    const CP_L: f32 = -0.000117368574;
    // log₂ 1.5
    const DP_H: f32 = 0.58496094;
    const DP_L: f32 = 1.5632208e-06;
    let bits = x.to_bits() as i32;
    let fraction = bits & 0x007f_ffff;
    // x = 2ⁿ · ax, with ax near 1 or near 1.5.
    let near_next = i32::from(fraction >= 0x005d_b3d7);
    let n = (bits >> 23) - 0x7f + near_next;
    let middle = i32::from(fraction > 0x001c_c471) & (1 - near_next);
    let normal = (fraction | 0x3f80_0000) - (near_next << 23);
    let ax = f32::from_bits(normal as u32);
    let k = middle as f32;
    let bp = 1.0 + 0.5 * k;
    // s = (ax − bp) / (ax + bp)
    let u = ax - bp;
    let v = 1.0 / (ax + bp);
    let s = u * v;
    let s_h = high(s);
    let t_h = f32::from_bits(
        (((normal as u32 >> 1) & 0xffff_f000) | 0x2000_0000)
            .wrapping_add(0x0040_0000)
            .wrapping_add((middle as u32) << 21),
    );
    let t_l = ax - (t_h - bp);
    let s_l = v * ((u - s_h * t_h) - s_h * t_l);
    // log ax
    let s2 = s * s;
    let series = L[0] + s2 * (L[1] + s2 * (L[2] + s2 * (L[3] + s2 * (L[4] + s2 * L[5]))));
    let r = s2 * s2 * series + s_l * (s_h + s);
    let s2 = s_h * s_h;
    let t_h = high(3.0 + s2 + r);
    let t_l = r - ((t_h - 3.0) - s2);
    let u = s_h * t_h;
    let v = s_l * t_h + t_l * s;
    let p_h = high(u + v);
    let p_l = v - (p_h - u);
    let z_h = CP_H * p_h;
    let z_l = CP_L * p_h + p_l * CP + DP_L * k;
    let t = n as f32;
    let t1 = high(((z_h + z_l) + DP_H * k) + t);
    let t2 = z_l - (((t1 - t) - DP_H * k) - z_h);
    (t1, t2)
}

/// Returns 2^(p_h + p_l).
#[inline(always)]
fn exp2(p_h: f32, p_l: f32) -> f32 {
    const P: [f32; 5] = [
        0.16666667,
        -0.0027777778,
        6.613756e-05,
        -1.6533902e-06,
        4.138137e-08,
    ];
    const LG2: f32 = std::f32::consts::LN_2;
    const LG2_H: f32 = 0.69314575;
    const LG2_L: f32 = 1.4286065e-06;
    // The whole part of z, rounded to the nearest, if |z| > 0.5.
    let z = p_l + p_h;
    let j = z.to_bits() as i32;
    let exponent = ((j & 0x7fff_ffff) >> 23) - 0x7f;
    let rounded = j.wrapping_add(0x0080_0000_i32.wrapping_shr((exponent + 1) as u32));
    let exponent = ((rounded & 0x7fff_ffff) >> 23) - 0x7f;
    let whole = ((rounded & 0x007f_ffff) | 0x0080_0000).wrapping_shr((23 - exponent) as u32);
    let signed = if j < 0 { -whole } else { whole };
    let n = if (j & 0x7fff_ffff) > 0x3f00_0000 {
        signed
    } else {
        0
    };
    let p_h = p_h - n as f32;
    let t = f32::from_bits((p_l + p_h).to_bits() & 0xffff_8000);
    let u = t * LG2_H;
    let v = (p_l - (t - p_h)) * LG2 + t * LG2_L;
    let z = u + v;
    let w = v - (z - u);
    let t = z * z;
    let t1 = z - t * (P[0] + t * (P[1] + t * (P[2] + t * (P[3] + t * P[4]))));
    let r = (z * t1) / (t1 - 2.0) - (w + z * w);
    let z = 1.0 - (r - z);
    f32::from_bits((z.to_bits() as i32).wrapping_add(n << 23) as u32)
}

#[cfg(test)]
mod tests {
    use super::powers;
    use crate::rl::dice::LearnerRng;

    fn check(numbers: &[f32], exponent: f32) {
        let mut found = numbers.to_vec();
        powers(&mut found, exponent);
        for (x, found) in numbers.iter().zip(found) {
            let expected = libm::powf(*x, exponent);
            let same =
                found.to_bits() == expected.to_bits() || (found.is_nan() && expected.is_nan());
            assert!(same, "{x:e} to {exponent}: {found:e}, not {expected:e}");
        }
    }

    #[test]
    fn powers_have_the_bits_of_libm() {
        let mut dice = LearnerRng::new(1);
        for round in 0..4000 {
            let exponent = match round % 8 {
                0 => 0.6,
                1 => -0.4,
                _ => (2.0 * dice.unit() - 1.0) as f32,
            };
            // 100 magnitudes, and half of the numbers within a factor of 2 of 1.
            let wide = |dice: &mut LearnerRng| libm::exp(46.0 * (2.0 * dice.unit() - 1.0)) as f32;
            let numbers: Vec<f32> = (0..67)
                .map(|i| {
                    if i % 2 == 0 {
                        wide(&mut dice)
                    } else {
                        (0.5 + 1.5 * dice.unit()) as f32
                    }
                })
                .collect();
            check(&numbers, exponent);
        }
    }

    #[test]
    fn powers_at_the_edges_have_the_bits_of_libm() {
        // Neighbours of the borders between the intervals of the logarithm, and of 1.
        let borders = [0x3f80_0000_u32, 0x3f9c_c471, 0x3fdd_b3d7, 0x4000_0000];
        let near = |bits: &u32| {
            (bits - 40..bits + 40)
                .map(f32::from_bits)
                .collect::<Vec<_>>()
        };
        let usual: Vec<f32> = borders.iter().flat_map(near).collect();
        for exponent in [0.6, -0.4, -0.999, 0.0, 0.5, 1.0, -1.0, 2.0, 1e-20, f32::NAN] {
            check(&usual, exponent);
            for special in [0.0, -1.0, 1e-40, 1e38, f32::INFINITY, f32::NAN] {
                check(&[0.7, special, 1.3], exponent);
            }
        }
        check(&[], 0.6);
    }
}
