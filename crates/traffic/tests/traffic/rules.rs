//! Rules over recordings against a count by hand.

use brakecheck_traffic::{
    BoundRules, ColumnMap, LaneFrame, Lead, Leads, RuleResult, TrafficRecording, TrafficRule,
    TrafficRuleFile, read_csv,
};

use crate::situations::recorded;
use crate::synthetic;

fn file(rules: &[&str]) -> TrafficRuleFile {
    let mut file = TrafficRuleFile::parse(TrafficRuleFile::motorway_text()).expect("shipped");
    let rule = |stl: &&str| TrafficRule {
        name: (*stl).to_owned(),
        stl: (*stl).to_owned(),
    };
    file.rules = rules.iter().map(rule).collect();
    file
}

fn results(recording: &TrafficRecording, rules: &[&str]) -> (Vec<RuleResult>, Leads) {
    let frame = LaneFrame::fit(recording);
    let leads = Leads::find(recording, &frame);
    let bound = BoundRules::bind(&file(rules), recording).unwrap_or_else(|it| panic!("{it}"));
    let results = bound.evaluate(recording, &frame, &leads);
    (results.unwrap_or_else(|it| panic!("{it}")), leads)
}

#[test]
fn rows_episodes_and_the_worst_instant_are_those_of_a_count_by_hand() {
    let (rows, _) = synthetic::traffic(4, 20, 60.0);
    let recording = recorded(&rows);
    let stl = "always (lead.present implies ego.lead.gap >= 1.3 * ego.speed)";
    let (found, leads) = results(&recording, &[stl]);
    let (mut broken, mut episodes, mut vehicles) = (0, 0, 0);
    let mut worst = (0.0, String::new(), 0.0);
    for (track, leads) in recording.tracks.iter().zip(&leads.of) {
        let mut last = None;
        for (i, lead) in leads.iter().enumerate() {
            // Overlapping boxes are no evidence.
            let Some(lead) = lead.filter(|it| it.gap_m >= 0.0) else {
                continue;
            };
            let rho = lead.gap_m - 1.3 * track.speed_mps[i];
            if rho < 0.0 {
                broken += 1;
                vehicles += usize::from(last.is_none());
                episodes += usize::from(last.is_none_or(|last| i - last > 20));
                last = Some(i);
            }
            if rho < worst.0 {
                let time_s = (track.first_sample + i) as f64 * recording.dt_s;
                worst = (rho, track.id.clone(), time_s);
            }
        }
    }
    let found = &found[0];
    assert!(broken > 100 && episodes > 10, "{broken}, {episodes}");
    assert_eq!((found.rows_broken, found.episodes), (broken, episodes));
    assert_eq!(
        (found.vehicles, found.rows),
        (vehicles, recording.counts.rows)
    );
    assert!((found.share() - broken as f64 / recording.counts.rows as f64).abs() < 1e-12);
    let rate = 1000.0 * episodes as f64 / recording.distance_km();
    assert!((found.per_1000_km() - rate).abs() < 1e-9 * rate);
    let at = found.worst.as_ref().expect("an episode");
    assert!((at.robustness - worst.0).abs() < 1e-9);
    assert_eq!((&at.id, at.time_s), (&worst.1, worst.2));
}

#[test]
fn a_rule_about_the_lead_says_nothing_without_one() {
    let (rows, _) = synthetic::traffic(5, 15, 40.0);
    let recording = recorded(&rows);
    let stl = [
        "lead.present implies ego.lead.gap >= 500",
        "not lead.present",
    ];
    let (found, leads) = results(&recording, &stl);
    let clear = |it: &&Lead| it.gap_m >= 0.0;
    let count = |it: &Vec<Option<Lead>>| it.iter().flatten().filter(clear).count();
    let with_lead: usize = leads.of.iter().map(count).sum();
    assert!(with_lead > 0 && with_lead < recording.counts.rows);
    assert_eq!(found[0].rows_broken, with_lead);
    assert_eq!(found[1].rows_broken, with_lead);
    // The trap: as a number, presence would make the robustness 0 at every violation.
    let worst = found[0].worst.as_ref().expect("a violation");
    assert!(worst.robustness < -380.0, "{}", worst.robustness);
}

#[test]
fn presence_as_a_number_is_refused() {
    let (rows, _) = synthetic::traffic(5, 5, 10.0);
    let recording = recorded(&rows);
    let error = BoundRules::bind(
        &file(&["lead.present == 1 implies ego.lead.gap >= 2"]),
        &recording,
    )
    .err()
    .expect("refused");
    assert!(error.to_string().contains("lead.present"), "{error}");
}

#[test]
fn an_unknown_signal_names_its_rule() {
    let (rows, _) = synthetic::traffic(5, 5, 10.0);
    let recording = recorded(&rows);
    let error = BoundRules::bind(&file(&["ego.sped > 3"]), &recording)
        .err()
        .expect("refused");
    assert!(
        error.to_string().starts_with("rule `ego.sped > 3`"),
        "{error}"
    );
    assert!(error.help().contains("ego.speed"), "{}", error.help());
}

#[test]
fn interpolated_rows_break_no_rule() {
    let row = |t: usize, id: &str, x: f64, is_made_up: bool| {
        format!("{},{id},{x},0,30,0,4,2,{is_made_up}", 0.1 * t as f64)
    };
    let mut text = "time,id,x,y,speed,heading,length,width,made_up\n".to_owned();
    for t in 0..100 {
        let near = [30.0, 80.0].map(|it: f64| (it - t as f64).abs());
        let gap_m = (4.0 + 2.0 * near[0].min(near[1])).min(40.0);
        let x = 3.0 * t as f64;
        text += &format!("{}\n", row(t, "lead", x + gap_m + 4.0, false));
        text += &format!("{}\n", row(t, "own", x, (20..40).contains(&t)));
    }
    let mut map = ColumnMap::shipped("generic").expect("shipped");
    let read = |map: &ColumnMap| read_csv(text.as_bytes(), "log.csv", map).expect("rows");
    let rule = ["lead.present implies ego.lead.gap >= 10"];
    let (all, _) = results(&read(&map), &rule);
    assert_eq!(
        (all[0].rows_broken, all[0].episodes, all[0].doubtful),
        (10, 2, 0)
    );
    map.interpolated = Some("made_up".to_owned());
    let (clean, _) = results(&read(&map), &rule);
    assert_eq!(
        (clean[0].rows_broken, clean[0].episodes, clean[0].doubtful),
        (5, 1, 1)
    );
}

#[test]
fn the_shipped_rules_bind_to_their_signals() {
    let (rows, _) = synthetic::traffic(6, 5, 10.0);
    let recording = recorded(&rows);
    let file = TrafficRuleFile::parse(TrafficRuleFile::motorway_text()).expect("shipped");
    assert_eq!(file.rules.len(), 10);
    assert!(BoundRules::bind(&file, &recording).is_ok());
}
