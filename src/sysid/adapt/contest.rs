//! The competition of members: proposals, races, and who wins.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::adversary::OTHERS;
use crate::run_dir::RunError;
use crate::seed;
use crate::stats::{draw, refit};
use crate::world::{EgoSample, Family};

/// The member found.
#[derive(Clone, Debug, PartialEq)]
pub struct Adapted {
    /// What the ado is best told.
    pub member: EgoSample,
    /// Whether it is another than the first member.
    pub is_better: bool,
    /// What is worth a further try, the most promising first.
    pub others: Vec<EgoSample>,
    /// Members tried.
    pub tried: usize,
    /// Share of the starts of the last race that the ado solves told `member`.
    pub success_rate: f64,
    /// The same told the first member.
    pub first_success_rate: f64,
    /// Starts of the last race.
    pub starts: u64,
    /// Simulations of the ego spent.
    pub simulations: u64,
    /// Those among them in which the ego itself failed to run; they say nothing.
    pub invalid: u64,
}

/// Share of the simulations in which members are proposed; the others race.
const PROPOSING: f64 = 0.6;
/// Generations of proposed members.
const GENERATIONS: u64 = 4;
/// Starts per generation, the same for all of its members.
const STARTS: u64 = 4;
/// Probability with which a quantity of a first proposal is the first member's.
const KEPT: f64 = 0.5;
/// Members that are tried again in the next generation.
const SURVIVORS: usize = 4;
/// Members about which the next generation is drawn.
const ELITES: usize = 6;
/// Least standard deviation there, of a range from −1 to 1.
const LEAST_SPREAD: f64 = 0.15;
/// A mean over few starts counts as if so many more had made no difference.
const DOUBT: f64 = 4.0;
/// The races, in turn.
const RACES: [HalvingRound; 2] = [
    HalvingRound {
        finalists: 5,
        share: 0.4,
    },
    HalvingRound {
        finalists: 2,
        share: 1.0,
    },
];
/// Standard errors, in the last race, by which a member must beat the first one.
const CLEARLY: f64 = 1.0;

/// Members that play some more starts.
struct HalvingRound {
    /// How many, beside the first member.
    finalists: usize,
    /// Share of the simulations that are left.
    share: f64,
}

/// What a run came to: its reward, none if the ego failed to run, and whether
/// the ado succeeded.
pub(super) type RewardAndSuccess = (Option<f64>, bool);

/// Makes ados of members.
pub(super) type Tell<'a, P> = &'a dyn Fn(&[EgoSample]) -> Result<Vec<P>, RunError>;
/// Lets ados play starts. `None`: stopped.
pub(super) type Meet<'a, P> = &'a dyn Fn(&[(&P, u64)]) -> Option<Vec<RewardAndSuccess>>;

/// The rules under which members compete; `P` is an ado that was told one.
pub(super) struct SuccessiveHalving<'a, P> {
    pub family: &'a Family,
    pub first: &'a EgoSample,
    pub simulations: u64,
    pub seed: u64,
    pub tell: Tell<'a, P>,
    pub meet: Meet<'a, P>,
}

impl<P> SuccessiveHalving<'_, P> {
    /// Holds it. `None`: stopped.
    pub fn run(&self, progress: &dyn Fn(u64, u64)) -> Result<Option<Adapted>, RunError> {
        let mut field = CandidatePool {
            candidates: Vec::new(),
            starts: 0,
            simulations: 0,
            invalid: 0,
        };
        self.enter(&mut field, vec![self.first.clone()])?;
        let proposing = (self.simulations as f64 * PROPOSING) as u64;
        let population = (proposing / (GENERATIONS * STARTS)) as usize;
        let total = GENERATIONS + RACES.len() as u64;
        for generation in 0..GENERATIONS {
            let mut playing = field.best(SURVIVORS);
            let new = population.saturating_sub(1 + playing.len());
            let proposed = self.propose(&field, generation, new);
            playing.extend(self.enter(&mut field, proposed)?);
            if field.play(&playing, STARTS, self.meet).is_none() {
                return Ok(None);
            }
            progress(generation + 1, total);
        }
        let (mut last_race, mut finalists) = (0, Vec::new());
        for (race, number) in RACES.into_iter().zip(GENERATIONS + 1..) {
            finalists = field.best(race.finalists);
            last_race = field.starts;
            let left = self.simulations.saturating_sub(field.simulations) as f64;
            let starts = (race.share * left) as u64 / (finalists.len() as u64 + 1);
            if field.play(&finalists, starts, self.meet).is_none() {
                return Ok(None);
            }
            progress(number, total);
        }
        Ok(Some(field.conclude(&finalists, last_race)))
    }

    /// Members to try.
    fn propose(&self, field: &CandidatePool<P>, generation: u64, count: usize) -> Vec<EgoSample> {
        let mut dice = seed::generator("adapt", &[self.seed, generation]);
        let plant = self.first.plant;
        let elites = field.best(ELITES);
        if elites.is_empty() {
            let nominal = self.family.nominal(plant);
            let about = (1..count).map(|_| self.beside_first(&mut dice));
            return std::iter::once(nominal).chain(about).collect();
        }
        let elites: Vec<&Vec<f64>> = elites.iter().map(|&i| &field.candidates[i].point).collect();
        let (mean, spread) = refit(&elites, LEAST_SPREAD);
        (0..count)
            .map(|_| self.family.at(&draw(&mean, &spread, &mut dice), plant))
            .collect()
    }

    /// The first member with some quantities drawn anew.
    fn beside_first(&self, dice: &mut ChaCha8Rng) -> EgoSample {
        let pairs = self.family.quantities.iter().zip(&self.first.values);
        let values = pairs.map(|(quantity, &own)| {
            let (kept, unit) = (dice.random::<f64>(), dice.random_range(-1.0..=1.0));
            if kept < KEPT { own } else { quantity.at(unit) }
        });
        EgoSample {
            values: values.collect(),
            ..self.first.clone()
        }
    }

    /// Adds members and gives their positions; one that sounds like another to
    /// the ado is not added again.
    fn enter(
        &self,
        field: &mut CandidatePool<P>,
        members: Vec<EgoSample>,
    ) -> Result<Vec<usize>, RunError> {
        let from = field.candidates.len();
        let mut heard: Vec<Vec<f32>> = field
            .candidates
            .iter()
            .map(|known| self.family.told(&known.member))
            .collect();
        let mut new = Vec::new();
        for member in members {
            let told = self.family.told(&member);
            if !heard.contains(&told) {
                heard.push(told);
                new.push(member);
            }
        }
        let ados = (self.tell)(&new)?;
        let entered = new.into_iter().zip(ados).map(|(member, ado)| Candidate {
            point: self.family.unit(&member),
            member,
            ado,
            played: Vec::new(),
        });
        field.candidates.extend(entered);
        Ok((from..field.candidates.len()).collect())
    }
}

/// A run of a member beside that of the first member from the same start.
struct Pair {
    start: u64,
    reward: f64,
    first_reward: f64,
    is_success: bool,
}

/// A member, the ado that is told it, and how it fared so far.
struct Candidate<P> {
    point: Vec<f64>,
    member: EgoSample,
    ado: P,
    played: Vec<Pair>,
}

impl<P> Candidate<P> {
    /// Its runs from the starts that were played from one on.
    fn since(&self, start: u64) -> impl Iterator<Item = &Pair> {
        self.played.iter().filter(move |pair| start <= pair.start)
    }

    /// Mean advantage over the first member since a start, and its standard error.
    fn advantage(&self, since: u64) -> (f64, f64) {
        let over = self
            .since(since)
            .map(|pair| pair.reward - pair.first_reward);
        let over: Vec<f64> = over.collect();
        let count = over.len().max(1) as f64;
        let mean = over.iter().sum::<f64>() / count;
        let squares = over.iter().map(|over| (over - mean).powi(2));
        let variance = squares.sum::<f64>() / (count - 1.0).max(1.0);
        (mean, (variance / count).sqrt())
    }

    /// The advantage over all starts, held the nearer to none the fewer they are.
    fn worth(&self) -> f64 {
        let count = self.played.len() as f64;
        self.advantage(0).0 * count / (count + DOUBT)
    }

    fn success_rate(&self, since: u64) -> f64 {
        let solved = self.since(since).filter(|pair| pair.is_success).count();
        solved as f64 / self.since(since).count().max(1) as f64
    }
}

/// Everybody who competes, the first member in front.
struct CandidatePool<P> {
    candidates: Vec<Candidate<P>>,
    starts: u64,
    simulations: u64,
    invalid: u64,
}

impl<P> CandidatePool<P> {
    /// The best that were played, without the first member, the best in front.
    fn best(&self, count: usize) -> Vec<usize> {
        let played = (1..self.candidates.len()).filter(|&i| !self.candidates[i].played.is_empty());
        let mut order: Vec<usize> = played.collect();
        // Of equals the one that was proposed first: a stable sort.
        let worth = |i: &usize| self.candidates[*i].worth();
        order.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
        order.truncate(count);
        order
    }

    /// Plays the first member and others on so many new starts, at least one,
    /// the same for all. `None`: stopped.
    fn play(&mut self, others: &[usize], starts: u64, meet: Meet<'_, P>) -> Option<()> {
        let starts = starts.max(1);
        let new: Vec<u64> = (self.starts..self.starts + starts).collect();
        let everybody: Vec<usize> = std::iter::once(0).chain(others.iter().copied()).collect();
        let runs: Vec<(&P, u64)> = everybody
            .iter()
            .flat_map(|&who| new.iter().map(move |&start| (who, start)))
            .map(|(who, start)| (&self.candidates[who].ado, start))
            .collect();
        let outcomes = meet(&runs)?;
        self.starts += starts;
        self.simulations += outcomes.len() as u64;
        let invalid = outcomes.iter().filter(|(reward, _)| reward.is_none());
        self.invalid += invalid.count() as u64;
        let (firsts, _) = outcomes.split_at(new.len());
        for (&who, own) in everybody.iter().zip(outcomes.chunks(new.len())) {
            let both = own.iter().zip(firsts).zip(&new);
            // A run in which the ego failed to run compares with nothing.
            let pairs = both.filter_map(|((own, first), &start)| {
                Some(Pair {
                    start,
                    reward: own.0?,
                    first_reward: first.0?,
                    is_success: own.1,
                })
            });
            self.candidates[who].played.extend(pairs);
        }
        Some(())
    }

    /// The best of the last race in front, if it beats the first member there
    /// by more than a standard error, and else that one.
    fn conclude(&self, finalists: &[usize], last_race: u64) -> Adapted {
        let candidate = |i: usize| &self.candidates[i];
        let worth = |i: &&usize| candidate(**i).worth();
        let winner = finalists
            .iter()
            .max_by(|a, b| worth(a).total_cmp(&worth(b)))
            .filter(|winner| {
                let (mean, error) = candidate(**winner).advantage(last_race);
                CLEARLY * error < mean
            })
            .copied()
            .unwrap_or(0);
        // The first member is worth the first try after it.
        let others = std::iter::once(0)
            .chain(self.best(OTHERS))
            .filter(|&other| other != winner)
            .take(OTHERS);
        Adapted {
            member: candidate(winner).member.clone(),
            is_better: winner != 0,
            others: others.map(|i| candidate(i).member.clone()).collect(),
            tried: self.candidates.len(),
            success_rate: candidate(winner).success_rate(last_race),
            first_success_rate: candidate(0).success_rate(last_race),
            starts: self.starts - last_race,
            simulations: self.simulations,
            invalid: self.invalid,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::PlantKind;
    use crate::sysid::adapt::LEAST_SIMULATIONS;
    use crate::world::{Scenario, Varied};

    fn world() -> Scenario {
        Scenario::load("worlds/acc.ron".as_ref()).expect("it loads")
    }

    /// Ados whose chance on a start falls with their distance from `best`.
    fn run(family: &Family, best: &[f64], (simulations, seed): (u64, u64)) -> Adapted {
        let nominal = family.nominal(PlantKind::Kinematic);
        let contest = SuccessiveHalving {
            family,
            first: &nominal,
            simulations,
            seed,
            tell: &|members| Ok(members.iter().map(|member| family.unit(member)).collect()),
            meet: &|pairs: &[(&Vec<f64>, u64)]| {
                let outcomes = pairs.iter().map(|(point, start)| {
                    let apart = point.iter().zip(best).map(|(a, b)| (a - b).powi(2));
                    let chance = (-apart.sum::<f64>()).exp();
                    let dice: f64 = seed::generator("test", &[seed, *start]).random();
                    let success = dice < chance;
                    // A failure is the less bad the nearer it came, as in Definition 4.
                    let reward = if success { 0.6 } else { 0.5 * chance - 1.0 };
                    // Every 20th start, the ego fails to run.
                    ((start % 20 != 7).then_some(reward), success)
                });
                Some(outcomes.collect())
            },
        };
        let found = contest.run(&|_, _| {}).expect("no disk");
        found.expect("not stopped")
    }

    #[test]
    fn a_far_better_member_is_found_within_the_simulations() {
        let world = world();
        let family = world.family().expect("a family");
        let nominal = family.nominal(PlantKind::Kinematic);
        let best = [0.8, 0.5, 0.7, -0.8, 0.3, 0.6];
        for seed in 0..5 {
            let found = run(family, &best, (600, seed));
            assert!((560..=600).contains(&found.simulations), "{found:?}");
            assert!(0 < found.invalid && found.is_better, "{found:?}");
            let apart = |member: &EgoSample| -> f64 {
                let point = family.unit(member);
                point.iter().zip(best).map(|(a, b)| (a - b).powi(2)).sum()
            };
            assert!(apart(&found.member) < 0.5 * apart(&nominal), "{found:?}");
            assert!(
                found.first_success_rate + 0.1 < found.success_rate,
                "{found:?}"
            );
            assert_eq!(found.others[0], nominal);
            assert!(!found.others.contains(&found.member), "{found:?}");
        }
    }

    #[test]
    fn the_first_member_stays_where_it_is_the_best() {
        let world = world();
        let family = world.family().expect("a family");
        let nominal = family.nominal(PlantKind::Kinematic);
        let best = family.unit(&nominal);
        for seed in 0..5 {
            let found = run(family, &best, (600, seed));
            assert!(!found.is_better && found.member == nominal, "{found:?}");
        }
    }

    #[test]
    fn few_simulations_and_a_single_quantity_of_few_values_are_no_hindrance() {
        let world = world();
        let mut family = world.family().expect("a family").clone();
        family.quantities.retain(|q| q.varied == Varied::Delay);
        for seed in 0..40 {
            let found = run(&family, &[1.0], (LEAST_SIMULATIONS, seed));
            // 0 to 0.2 s in steps of 0.05 s.
            assert!(found.tried <= 5, "{found:?}");
            assert!(found.simulations <= LEAST_SIMULATIONS, "{found:?}");
        }
    }
}
