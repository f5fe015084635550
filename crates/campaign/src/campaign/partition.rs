//! Parts of a campaign for machines that share nothing.

use std::fmt;
use std::num::NonZeroUsize;
use std::str::FromStr;

use super::plan::{CampaignPiece, Plan, Work};

/// Share of the pieces of a campaign, written `I/N`: the I-th of N, from 1.
///
/// The partitions of one N contain every piece. Only trainings are in several: a partition
/// has the trainings of its own pieces, so it needs no other partition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Partition {
    /// Remainder of the numbers of its pieces.
    remainder: usize,
    count: NonZeroUsize,
}

/// Text that is no partition.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a partition is I/N with 1 ≤ I ≤ N, such as 2/8")]
pub struct PartitionError;

impl Partition {
    /// All pieces.
    pub const WHOLE: Partition = Partition {
        remainder: 0,
        count: NonZeroUsize::MIN,
    };

    /// Returns the pieces of this partition, in the order of the plan.
    pub(super) fn pieces(self, plan: &Plan) -> Vec<CampaignPiece> {
        let mut has_training = vec![false; plan.trainings.len()];
        // Neighbours cost about the same, so each partition has every N-th piece.
        let is_own = |piece: &CampaignPiece| piece.number % self.count == self.remainder;
        for piece in plan.pieces().filter(is_own) {
            let training = match piece.work {
                Work::Training(training) => Some(training),
                Work::Starts { unit, .. } => plan.units[unit].ado.training,
            };
            if let Some(training) = training {
                has_training[training] = true;
            }
        }
        let belongs = |piece: &CampaignPiece| match piece.work {
            Work::Training(training) => has_training[training],
            Work::Starts { .. } => is_own(piece),
        };
        plan.pieces().filter(belongs).collect()
    }
}

impl FromStr for Partition {
    type Err = PartitionError;

    fn from_str(text: &str) -> Result<Partition, PartitionError> {
        let (index, count) = text.split_once('/').ok_or(PartitionError)?;
        // `parse` also accepts a sign.
        let number = |digits: &str| {
            let is_plain = digits.bytes().all(|byte| byte.is_ascii_digit());
            digits.parse::<NonZeroUsize>().ok().filter(|_| is_plain)
        };
        let index = number(index).ok_or(PartitionError)?;
        let count = number(count).ok_or(PartitionError)?;
        if index > count {
            return Err(PartitionError);
        }
        Ok(Partition {
            remainder: index.get() - 1,
            count,
        })
    }
}

impl fmt::Display for Partition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.remainder + 1, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_that_name_no_share_are_refused() {
        for text in ["1/1", "2/8", "8/8"] {
            let partition: Partition = text.parse().expect(text);
            assert_eq!(partition.to_string(), text);
        }
        for text in [
            "",
            "1",
            "/",
            "0/4",
            "5/4",
            "1/0",
            "-1/4",
            "+1/4",
            "1/4/2",
            "a/b",
            "1.0/4",
            " 1/4",
            "1/99999999999999999999",
        ] {
            assert_eq!(text.parse::<Partition>(), Err(PartitionError), "{text:?}");
        }
    }
}
