//! Loops over the numbers of networks.

use super::kernel::Loop;

/// Moves numbers toward others by a share of the difference.
pub(super) struct Blend<'a> {
    pub(super) own: &'a mut [f32],
    pub(super) other: &'a [f32],
    pub(super) share: f32,
}

impl Loop for Blend<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (own, other) in self.own.iter_mut().zip(self.other) {
            *own += self.share * (other - *own);
        }
    }
}

/// Sets hidden units below 0 to 0.
pub(super) struct Relu<'a>(pub(super) &'a mut [f32]);

impl Loop for Relu<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for value in self.0 {
            // Not `max`, which leaves the sign of a zero open.
            *value = if *value > 0.0 { *value } else { 0.0 };
        }
    }
}

/// Sets the deltas of hidden units to 0 that were off.
pub(super) struct Mask<'a> {
    pub(super) deltas: &'a mut [f32],
    pub(super) hidden: &'a [f32],
}

impl Loop for Mask<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (delta, on) in self.deltas.iter_mut().zip(self.hidden) {
            *delta = if *on > 0.0 { *delta } else { 0.0 };
        }
    }
}
