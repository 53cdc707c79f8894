//! A comparison computed in parts.

use serde_json::Value;

use crate::cli::{body_schema, failure, json};

#[test]
fn parts_that_were_computed_apart_merge_to_what_one_run_gives() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("text").to_owned();
    let common = ["compare", "arm-6dof", "--learner", "global", "--learner", "random"];
    fn with<'a>(common: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
        [common, more].concat()
    }
    let part = |shard: &str, steps: &str, path: &str| {
        let more = ["--seeds", "3..9", "--steps", steps, "--shard", shard, "--part", path];
        let output = body_schema(&with(&common, &more));
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    let parts = ["1/3", "2/3", "3/3"].map(|shard| (shard, place(&shard.replace('/', "-"))));
    parts.iter().for_each(|(shard, path)| part(shard, "12", path));
    let [one, two, three] = parts.map(|(_, path)| path);
    let without_times = |mut value: Value| {
        for learner in value["learners"].as_array_mut().expect("learners") {
            assert!(learner["selection_ms"].take().is_object());
        }
        value
    };
    let whole = without_times(json(&with(&common, &["--seeds", "3..9", "--steps", "12", "--json", "-"])));
    assert_eq!(without_times(json(&["merge", &three, &one, &two, "--json", "-"])), whole);

    // What does not fit together is named.
    let other = place("other");
    part("2/3", "11", &other);
    std::fs::write(place("cut"), &std::fs::read(&two).expect("a file")[..2000]).expect("written");
    std::fs::write(place("text"), "not compressed").expect("written");
    let (cut, text) = (place("cut"), place("text"));
    for (named, words) in [
        (vec![&one, &three], "parts are missing: 2/3"),
        (vec![&one, &two, &three, &two], "name each part once"),
        (vec![&one, &other, &three], "another number of movements"),
        (vec![&one, &cut, &three], "not whole"),
        (vec![&one, &text, &three], "no part of a comparison"),
    ] {
        let (code, told) =
            failure(&[&["merge"], &named.iter().map(|path| path.as_str()).collect::<Vec<_>>()[..]].concat());
        assert!(code == 2 && told.contains(words), "{code} {told}");
    }
    let (code, told) = failure(&with(&common, &["--shard", "4/3", "--part", &other]));
    assert!(code == 2 && told.contains("counted from 1 to 3"), "{told}");
}
