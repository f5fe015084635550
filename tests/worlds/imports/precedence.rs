//! Which of two statements of a file counts: priorities, defaults and names.
//!
//! esmini 3.6 moves the entities alike.

use super::*;

/// Between two groups of conditions.
const OR: &str = "</ConditionGroup><ConditionGroup>";

#[test]
fn what_counts_of_two_statements_moves_the_lead() {
    let on_left = || {
        let place =
            r#"<LanePosition roadId="0" laneId="1" s="150"><Orientation h="0"/></LanePosition>"#;
        edit(LEAD, place)
    };
    let offset = CENTRE.replace(
        r#"AbsoluteTargetLaneOffset value="0""#,
        r#"AbsoluteTargetLaneOffset value="1""#,
    );
    let itself = |value: &str, more: &str| {
        aims_at(&format!(
            r#"<RelativeTargetSpeed entityRef="Lead" value="{value}" {more}/>"#
        ))
    };
    let change = || lane_change("sinusoidal", "time", 4.0);
    let at = |at_s: f64, action: &str| second(&time(at_s, "none", 0.0), action);
    let half_way_s = 2.0 + 0.5 * core::f64::consts::PI * 0.5_f64.sqrt();
    let near = || nearer(20.0, "none");
    let by = |at_s: f64| time(at_s, "none", 0.0);
    // An ego far ahead meets no lead on its lane.
    let far = || ego_at(400.0);
    table! {
        // The slanted way takes 9.5 cm of that along the road.
        "a change of speed stops a change of lane half-way":
            [does(change()), at(4.0, SLOWER), far()]
            => lead([(4.0, 189.9052, 1.75), (12.0, 239.9052, 1.75)]);
        // It takes π·√(1/2) s.
        "a change of speed stops a lane offset":
            [does(offset), at(half_way_s, SLOWER)] => lead([(12.0, 234.6643, 0.5)]);
        "a change of lane stops a change of speed":
            [does(SLOWER), at(4.0, &change()), far()] => lead([(12.0, 251.7626, 3.5)]);
        "a change of lane does not stop a change of speed of the Init":
            [
                edit(
                    r#"dynamicsShape="step" dynamicsDimension="time" value="0"/><!--init dynamics-->"#,
                    r#"dynamicsShape="linear" dynamicsDimension="time" value="5"/>"#,
                ),
                does(change()),
                far(),
            ] => lead([(12.0, 244.7532, 3.5)]);
        "a speed above the greatest of the body":
            [edit(r#"maxSpeed="70""#, r#"maxSpeed="8""#)]
            => lead([(2.0, 166.0, 0.0), (12.0, 214.0, 0.0)]);
        "an orientation without a type is absolute up to OpenSCENARIO 1.2":
            [on_left()] => lead([(12.0, 228.0, 7.0)]);
        "and relative from 1.3 on":
            [on_left(), edit(r#"revMinor="2""#, r#"revMinor="3""#)] => lead([(12.0, 72.0, 7.0)]);
        "a place without a heading faces along its road, also on oncoming lanes":
            [edit(LEAD, r#"<WorldPosition x="150" y="1.75"/>"#)] => lead([(12.0, 228.0, 7.0)]);
        "an event with an empty action changes nothing": [does("")] => lead([(12.0, 270.0, 0.0)]);
        "two times that must both have come":
            [first(by(2.0) + &by(4.0))] => lead([(12.0, 240.0, 0.0)]);
        "a distance after a time that has come before":
            [first(by(2.0) + &near())] => lead([(12.0, 260.143, 0.0)]);
        "a time after a distance that was reached before":
            [first(by(9.0) + &near())] => lead([(12.0, 265.5, 0.0)]);
        "a time before a distance, of which either is enough":
            [first(by(5.0) + OR + &near())] => lead([(12.0, 246.0, 0.0)]);
        "a distance before a time, of which either is enough":
            [first(by(9.0) + OR + &near())] => lead([(12.0, 260.143, 0.0)]);
        "a speed that is its own":
            [itself("0", r#"speedTargetValueType="delta" continuous="true""#)]
            => lead([(2.0, 170.0, 0.0), (12.0, 270.0, 0.0)]);
        "the whole of its own speed":
            [itself("1", r#"speedTargetValueType="factor" continuous="false""#)]
            => lead([(12.0, 270.0, 0.0)]);
    }
}

#[test]
fn bodies_of_one_name_keep_their_sizes() {
    let lead = lead_object("<!--lead vehicle-->");
    let longer = lead.replace(r#"length="4.4""#, r#"length="6""#);
    let imported = imported(&[edit(lead, longer)]);
    let text = &imported.worlds[0].text;
    for length in ["length_m: 4.4,", "length_m: 6.0,"] {
        assert!(text.contains(length), "{length} is not in {text}");
    }
    // The rear axle is where the file places it, whatever the body.
    let (x_m, _) = at_by(&run(&world(&imported)), "lead", 2.0, 1.4 + 3.0);
    assert!((x_m - 170.0).abs() < 0.02, "{x_m}");
}
