//! What fuzzing found once, each mended, each held here for good.

use brakecheck::rl::TensorFile;
use brakecheck::stl::Formula;
use brakecheck_rl::rl::list::load_policy;

/// Formulas whose canonical text did not read back.
const FORMULAS: [&str; 3] = [
    "always[0, 3.6893488147419103e19] (x > 1)",
    "eventually[0, 18446744073709551610] (x > 1)",
    "once[0, 1844674407370955161e6] (x > 1)",
];

#[test]
fn bounds_of_many_digits_read_back() {
    for text in FORMULAS {
        let formula: Formula = text.parse().expect(text);
        assert_eq!(formula.to_string().parse(), Ok(formula), "{text}");
    }
}

/// Shapes of weights that hold no number and yet name sizes: room was made for
/// networks of those sizes before anybody looked for their numbers.
const EMPTY_LAYERS: [&[&[usize]]; 4] = [
    &[&[usize::MAX, 0, 3]],
    &[&[1 << 40, 0, 3]],
    &[&[2, 4], &[0, 1 << 40]],
    &[&[2, 4], &[0, usize::MAX]],
];

#[test]
fn a_small_policy_file_cannot_ask_for_much_room() {
    for kind in ["brakecheck dqn policy 1", "brakecheck ppo policy 1"] {
        for shapes in EMPTY_LAYERS {
            for prefix in ["q", "actor", "critic"] {
                let mut bundle = TensorFile::new(kind);
                for (i, shape) in shapes.iter().enumerate() {
                    let count = shape.iter().fold(1usize, |all, n| all.wrapping_mul(*n));
                    let numbers = if shape.contains(&0) { 0 } else { count };
                    bundle.put(format!("{prefix}/{i}/weight"), shape, vec![0.5f32; numbers]);
                }
                assert!(load_policy(&bundle).is_err(), "{prefix} {shapes:?}");
            }
        }
    }
}
