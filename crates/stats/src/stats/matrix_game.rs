//! Equilibrium of a zero-sum matrix game, by regret matching.
//!
//! Both players use regret matching+ with alternating updates and linearly weighted
//! averages (Tammelin, "Solving large imperfect information games using CFR+", 2014).
//! The averages converge to an equilibrium. Their exploitability is computed from the
//! payoffs, so the result carries its own error.

/// Updates of both players at most.
const ITERATIONS: usize = 20_000;
/// Exploitability at which the iteration ends.
const ENOUGH: f64 = 1e-6;
/// Updates between two checks of the exploitability.
const CHECKS: usize = 100;

/// Mixed strategies of both players and the value of the game.
#[derive(Clone, Debug, PartialEq)]
pub struct Equilibrium {
    /// Probability of each row, whose player maximizes the payoff.
    pub rows: Vec<f64>,
    /// Probability of each column, whose player minimizes the payoff.
    pub columns: Vec<f64>,
    /// Expected payoff under both mixtures.
    pub value: f64,
    /// Sum of the gains of both players by their best pure responses, 0 or more.
    pub exploitability: f64,
}

impl Equilibrium {
    /// Solves the game with a payoff per row and column.
    ///
    /// The payoffs are finite, and every row has the same number of columns. An empty
    /// game has empty mixtures and the value 0.
    pub fn of(payoffs: &[Vec<f64>]) -> Equilibrium {
        let columns = payoffs.first().map_or(0, Vec::len);
        // Invariant: the matrix is complete.
        debug_assert!(payoffs.iter().all(|row| row.len() == columns));
        let mut row_player = MatrixPlayer::new(payoffs.len());
        let mut column_player = MatrixPlayer::new(columns);
        for iteration in 1..=ITERATIONS {
            let gains = row_gains(payoffs, &column_player.strategy());
            row_player.update(&gains, iteration);
            // Updates alternate as in CFR+, so the columns answer the new row strategy.
            let losses = column_losses(payoffs, &row_player.strategy());
            let gains: Vec<f64> = losses.iter().map(|loss| -loss).collect();
            column_player.update(&gains, iteration);
            // A check costs as much as the updates of both players.
            if iteration % CHECKS == 0 {
                let found = Equilibrium::rated(payoffs, &row_player, &column_player);
                if found.exploitability < ENOUGH {
                    return found;
                }
            }
        }
        Equilibrium::rated(payoffs, &row_player, &column_player)
    }

    fn rated(
        payoffs: &[Vec<f64>],
        row_player: &MatrixPlayer,
        column_player: &MatrixPlayer,
    ) -> Equilibrium {
        let (rows, columns) = (row_player.average(), column_player.average());
        let gains = row_gains(payoffs, &columns);
        let losses = column_losses(payoffs, &rows);
        let best = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = losses.iter().copied().fold(f64::INFINITY, f64::min);
        let value = rows.iter().zip(&gains).map(|(p, gain)| p * gain).sum();
        // An empty game has neither a best row nor a least column.
        let exploitability = if gains.is_empty() || losses.is_empty() {
            0.0
        } else {
            (best - least).max(0.0)
        };
        Equilibrium {
            rows,
            columns,
            value,
            exploitability,
        }
    }
}

/// Expected payoff of each row against a mixture of columns.
pub fn row_gains(payoffs: &[Vec<f64>], columns: &[f64]) -> Vec<f64> {
    let gain = |row: &Vec<f64>| row.iter().zip(columns).map(|(u, p)| u * p).sum();
    payoffs.iter().map(gain).collect()
}

/// Expected payoff of each column against a mixture of rows.
fn column_losses(payoffs: &[Vec<f64>], rows: &[f64]) -> Vec<f64> {
    let columns = payoffs.first().map_or(0, Vec::len);
    let loss = |column: usize| payoffs.iter().zip(rows).map(|(u, p)| u[column] * p).sum();
    (0..columns).map(loss).collect()
}

/// Positive regrets of a player, and the weighted sum of its strategies.
struct MatrixPlayer {
    regrets: Vec<f64>,
    sum: Vec<f64>,
}

impl MatrixPlayer {
    fn new(actions: usize) -> MatrixPlayer {
        MatrixPlayer {
            regrets: vec![0.0; actions],
            sum: vec![0.0; actions],
        }
    }

    /// Returns the strategy in proportion to the regrets.
    fn strategy(&self) -> Vec<f64> {
        normalized(&self.regrets)
    }

    fn average(&self) -> Vec<f64> {
        normalized(&self.sum)
    }

    /// Adds the regrets of the present strategy, and then the new strategy to the average.
    fn update(&mut self, gains: &[f64], iteration: usize) {
        let strategy = self.strategy();
        let expected: f64 = strategy.iter().zip(gains).map(|(p, gain)| p * gain).sum();
        for (regret, gain) in self.regrets.iter_mut().zip(gains) {
            // Regret matching+ forgets negative regrets, so a better action returns at
            // once.
            *regret = (*regret + gain - expected).max(0.0);
        }
        let strategy = self.strategy();
        for (sum, p) in self.sum.iter_mut().zip(&strategy) {
            // Linear weights, as in CFR+, let the early strategies fade.
            *sum += iteration as f64 * p;
        }
    }
}

/// Returns weights that sum to 1, equal ones if all are 0.
fn normalized(weights: &[f64]) -> Vec<f64> {
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        weights.iter().map(|weight| weight / sum).collect()
    } else {
        vec![1.0 / weights.len().max(1) as f64; weights.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(payoffs: &[&[f64]], rows: &[f64], columns: &[f64], value: f64) {
        let payoffs: Vec<Vec<f64>> = payoffs.iter().map(|row| row.to_vec()).collect();
        let found = Equilibrium::of(&payoffs);
        assert!(found.exploitability < 1e-3, "{found:?}");
        assert!((found.value - value).abs() < 1e-3, "{found:?}");
        for (found, expected) in [(&found.rows, rows), (&found.columns, columns)] {
            let pairs = found.iter().zip(expected);
            let off = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(found.len() == expected.len() && off < 0.01, "{found:?}");
        }
    }

    #[test]
    fn known_games_have_their_known_solutions() {
        let third = [1.0 / 3.0; 3];
        let rock_paper_scissors: [&[f64]; 3] =
            [&[0.0, -1.0, 1.0], &[1.0, 0.0, -1.0], &[-1.0, 1.0, 0.0]];
        check(&[&[1.0, -1.0], &[-1.0, 1.0]], &[0.5; 2], &[0.5; 2], 0.0);
        check(&rock_paper_scissors, &third, &third, 0.0);
        // Uniform mixtures solve the two above, but none of these.
        check(&[&[2.0, -1.0], &[-1.0, 1.0]], &[0.4, 0.6], &[0.4, 0.6], 0.2);
        // Mixtures of the two players differ.
        check(&[&[3.0, 0.0], &[1.0, 2.0]], &[0.25, 0.75], &[0.5, 0.5], 1.5);
        // A saddle point: neither player mixes.
        check(
            &[&[4.0, 2.0, 5.0], &[3.0, 1.0, 6.0], &[0.0, -2.0, 9.0]],
            &[1.0, 0.0, 0.0],
            &[0.0, 1.0, 0.0],
            2.0,
        );
        // A dominated third column is never played.
        check(
            &[&[1.0, -1.0, 2.0], &[-1.0, 1.0, 2.0]],
            &[0.5, 0.5],
            &[0.5, 0.5, 0.0],
            0.0,
        );
        check(&[&[0.7]], &[1.0], &[1.0], 0.7);
    }

    #[test]
    fn the_players_are_not_exchanged() {
        // The row player maximizes: it takes 5 of the two constant rows.
        check(&[&[1.0, 1.0], &[5.0, 5.0]], &[0.0, 1.0], &[0.5, 0.5], 5.0);
        // The column player minimizes.
        check(&[&[1.0, 5.0]], &[1.0], &[1.0, 0.0], 1.0);
    }

    #[test]
    fn the_exploitability_is_that_of_the_mixtures() {
        let payoffs: Vec<Vec<f64>> = (0..9)
            .map(|row: u64| {
                let value = |column: u64| ((row * 31 + column * 17 + row * column) % 23) as f64;
                (0..7).map(value).collect()
            })
            .collect();
        let found = Equilibrium::of(&payoffs);
        let best = row_gains(&payoffs, &found.columns)
            .into_iter()
            .fold(f64::NEG_INFINITY, f64::max);
        let least = column_losses(&payoffs, &found.rows)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        assert!((best - least - found.exploitability).abs() < 1e-12);
        assert!(least <= found.value && found.value <= best);
        assert!(found.exploitability < 0.01, "{found:?}");
        let nothing = Equilibrium::of(&[]);
        assert_eq!((nothing.value, nothing.exploitability), (0.0, 0.0));
    }
}
