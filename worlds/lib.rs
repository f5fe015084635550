//! Worlds that brakecheck ships, as texts.
//!
//! Part of [brakecheck](https://docs.rs/brakecheck). This crate makes no semver promise.

/// Name and text of a world.
macro_rules! world {
    ($name:literal) => {
        ($name, include_str!(concat!($name, ".ron")))
    };
}

/// Shipped worlds: their names and texts, in order.
pub const WORLDS: [(&str, &str); 37] = [
    world!("acc"),
    world!("acc_iso"),
    world!("acc_letter"),
    world!("acc_paper"),
    world!("acc_plain"),
    world!("acc_structures"),
    world!("bend"),
    world!("crest_bend"),
    world!("crossroads"),
    world!("cut_in"),
    world!("cut_in_clear"),
    world!("cut_in_story"),
    world!("cyclist"),
    world!("fog_queue"),
    world!("grid"),
    world!("grid_hard"),
    world!("grid_jump"),
    world!("junction"),
    world!("light_ado"),
    world!("merge"),
    world!("merge_fair"),
    world!("merge_letter"),
    world!("merge_paper"),
    world!("merge_plain"),
    world!("merge_r157"),
    world!("oncoming"),
    world!("pedestrian"),
    world!("pedestrian_hit"),
    world!("roundabout"),
    world!("sandwich"),
    world!("tightening_bend"),
    world!("turn_across"),
    world!("wet_bend"),
    world!("yellow_light"),
    world!("yellow_light_fixed"),
    world!("yellow_light_letter"),
    world!("yellow_light_plain"),
];

/// Names and texts of the points of test protocols, in order, made by `examples/openx/protocols.py`.
pub const PROTOCOLS: [(&str, &str); 71] = [
    world!("ncap/cbfa"),
    world!("ncap/cbfa_extended"),
    world!("ncap/cbla"),
    world!("ncap/cbla_extended"),
    world!("ncap/cbla_fcw"),
    world!("ncap/cbla_fcw_extended"),
    world!("ncap/cbna"),
    world!("ncap/cbna_extended"),
    world!("ncap/cbnao"),
    world!("ncap/cbnao_extended"),
    world!("ncap/cccscp_1"),
    world!("ncap/cccscp_2"),
    world!("ncap/cccscp_extended_1"),
    world!("ncap/cccscp_extended_2"),
    world!("ncap/ccfhos"),
    world!("ncap/ccfhos_extended"),
    world!("ncap/ccftap_1"),
    world!("ncap/ccftap_2"),
    world!("ncap/ccftap_3"),
    world!("ncap/ccftap_extended_1"),
    world!("ncap/ccftap_extended_2"),
    world!("ncap/ccftap_extended_3"),
    world!("ncap/ccrb"),
    world!("ncap/ccrb_extended"),
    world!("ncap/ccrm"),
    world!("ncap/ccrm_extended"),
    world!("ncap/ccrs"),
    world!("ncap/ccrs_extended"),
    world!("ncap/ccrs_fcw"),
    world!("ncap/ccrs_fcw_extended"),
    world!("ncap/cmcscp_1"),
    world!("ncap/cmcscp_2"),
    world!("ncap/cmcscp_extended_1"),
    world!("ncap/cmcscp_extended_2"),
    world!("ncap/cmftap_1"),
    world!("ncap/cmftap_2"),
    world!("ncap/cmftap_3"),
    world!("ncap/cmftap_extended_1"),
    world!("ncap/cmftap_extended_2"),
    world!("ncap/cmftap_extended_3"),
    world!("ncap/cmrb"),
    world!("ncap/cmrb_extended"),
    world!("ncap/cmrs"),
    world!("ncap/cmrs_extended"),
    world!("ncap/cmrs_fcw"),
    world!("ncap/cmrs_fcw_extended"),
    world!("ncap/cpfa"),
    world!("ncap/cpfa_extended"),
    world!("ncap/cpla"),
    world!("ncap/cpla_extended"),
    world!("ncap/cpla_fcw"),
    world!("ncap/cpla_fcw_extended"),
    world!("ncap/cpna"),
    world!("ncap/cpna_extended"),
    world!("ncap/cpnco"),
    world!("ncap/cpnco_extended"),
    world!("r157/cut_in_far"),
    world!("r157/cut_in_near"),
    world!("r157/cut_out"),
    world!("r157/cut_out_two"),
    world!("r157/detection_ahead"),
    world!("r157/detection_beside"),
    world!("r157/free_driving"),
    world!("r157/lead_brakes"),
    world!("r157/lead_slows"),
    world!("r157/pedestrian_crossing"),
    world!("r157/pedestrian_offset"),
    world!("r157/pedestrian_standing"),
    world!("r157/side_vehicle"),
    world!("r157/swerving_lead"),
    world!("r157/two_standing"),
];

/// Name and text of a road file.
macro_rules! road_file {
    ($name:literal) => {
        ($name, include_str!($name))
    };
}

/// Names and texts of the files that shipped worlds include.
pub const FILES: [(&str, &str); 2] = [road_file!("junction.xodr"), road_file!("roundabout.xodr")];
