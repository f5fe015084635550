//! Campaigns in parts, on machines that share nothing.

use std::collections::BTreeSet;
use std::path::Path;

use super::campaign::{merged, pieces, plan, refused, run};
use super::{brakecheck, code, copy, json, path, scratch, stderr};

/// Two trainings, each with pieces of its own, and pieces without one.
const TEXT: &str = r#"Campaign(
    name: "parts",
    worlds: [(file: "acc", plant: Kinematic)],
    ados: [Training(seeds: 2, decisions: 2000), Held, Search(switches: 0)],
    starts: Drawn(count: 30, seed: 100),
)"#;

/// Names of the pieces that are in a plan directory.
fn names(plan: &str) -> BTreeSet<String> {
    let names = pieces(plan).into_iter().map(|file| {
        let name = file.file_name().expect("a name");
        name.to_string_lossy().into_owned()
    });
    names.collect()
}

#[test]
fn partitions_are_merged_to_the_bytes_of_the_whole() {
    let dir = scratch();
    let whole = plan(&dir, "whole", TEXT, "0.02");
    let parts: Vec<String> = (1..=3)
        .map(|part| path(&dir, &format!("part{part}")))
        .collect();
    for (part, copied) in (1..).zip(&parts) {
        copy(Path::new(&whole), Path::new(copied));
        let share = format!("{part}/3");
        let output = brakecheck(&["campaign", "run", copied, "--partition", &share, "--json"]);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        let ran = json(&output);
        assert_eq!(ran["done"], ran["pieces"]);
        assert_eq!(ran["pieces"], names(copied).len());
    }
    run(&whole);
    let (hash, _) = merged(&whole);
    // Each piece without a training is in one part, and every part has work.
    let all = names(&whole);
    let trainings: BTreeSet<String> = [0, 1].map(|piece| format!("{piece:06}.jsonl")).into();
    let own: Vec<BTreeSet<String>> = parts.iter().map(|part| &names(part) - &trainings).collect();
    assert!(own.iter().all(|part| part.len() >= 2), "{own:?}");
    assert_eq!(own.iter().map(BTreeSet::len).sum::<usize>() + 2, all.len());
    let joined: BTreeSet<String> = own.into_iter().flatten().collect();
    assert_eq!(&joined | &trainings, all);

    let said = refused(&[&parts[0], "--with", &parts[2]]);
    assert!(said.contains("is missing"), "{said}");
    let [first, second, third] = &parts[..] else {
        unreachable!()
    };
    let merge = [
        "campaign", "merge", first, "--with", second, "--with", third, "--json",
    ];
    let output = brakecheck(&merge);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["sha256"], hash);
}

#[test]
fn a_partition_is_a_share_of_the_pieces_and_may_have_none() {
    let dir = scratch();
    let text = TEXT.replace("Training(seeds: 2, decisions: 2000), ", "");
    let planned = plan(&dir, "planned", &text, "1000");
    let output = brakecheck(&["campaign", "run", &planned, "--partition", "3/3"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("0 of 0 pieces of partition 3/3"), "{said}");
    for share in ["0/3", "4/3", "3", "-1/3"] {
        let argument = format!("--partition={share}");
        let output = brakecheck(&["campaign", "run", &planned, &argument]);
        assert_eq!(code(&output), 2, "{share}");
        assert!(
            stderr(&output).contains("such as 2/8"),
            "{}",
            stderr(&output)
        );
    }
    let both = [
        "campaign",
        "run",
        &planned,
        "--partition",
        "1/3",
        "--piece",
        "0",
    ];
    assert_eq!(code(&brakecheck(&both)), 2);
    assert_eq!(names(&planned).len(), 0);
}
