//! `--json` of the commands that write files: one object, whose keys are documented and do not change.

use painleve_tests::Bench;
use serde_json::{Value, json};

#[test]
fn every_step_of_a_sweep_prints_its_result() {
    let bench = Bench::new("json-sweep");
    let campaign = "study = 'bifurcation'\nmu = 0.4\nv-belt = '-0.5:-0.3:0.1'\ninitial = 'a'\n\
        transient-s = 1\nrecord-s = 1\n";
    std::fs::write(bench.path("campaign.toml"), campaign).unwrap_or_default();
    let sweep = |line: &str| {
        let words = format!("sweep {line} --json");
        bench.report(&words.split_whitespace().collect::<Vec<_>>())
    };
    let planned = sweep("plan campaign.toml --shards 2");
    let hash = planned["campaign_hash"].clone();
    let manifest = "out/sweep/manifest.toml";
    let expected = |is_new: bool| json!({ "manifest": manifest, "is_new": is_new, "campaign_hash": hash, "rows": 3, "shards": 2 });
    assert!(hash.is_string());
    assert_eq!(planned, expected(true));
    assert_eq!(sweep("plan campaign.toml --shards 2"), expected(false));
    assert_eq!(sweep("missing"), json!({ "shards": 2, "missing": "0-1" }));
    let shard = |shard: usize, rows: usize, computed: bool| {
        let file = format!("out/sweep/shard-{shard}.csv");
        json!({ "shard": shard, "rows": rows, "file": file, "computed": computed })
    };
    let finished = |shards: &[Value]| json!({ "shards": 2, "finished": shards });
    let first = sweep("run --shard 0/2");
    let rows = first["finished"][0]["rows"].as_u64().unwrap_or_default() as usize;
    assert_eq!(first, finished(&[shard(0, rows, true)]));
    let script = "out/sweep/sweep.sbatch";
    assert_eq!(
        sweep("submit slurm"),
        json!({ "missing": "1", "script": script, "command": format!("sbatch {script}") })
    );
    assert_eq!(
        sweep("run --all"),
        finished(&[shard(0, rows, false), shard(1, 3 - rows, true)])
    );
    assert_eq!(
        sweep("submit slurm"),
        json!({ "missing": "", "script": null, "command": null })
    );
    assert_eq!(
        sweep("merge"),
        json!({ "files": ["out/sweep/merged.csv"], "rows": 3, "shards": 2 })
    );
    assert_eq!(
        sweep("status"),
        json!({ "shards": 2, "rows": 3, "finished": 2, "missing": "", "unusable": [], "duplicates": [] })
    );
}

#[test]
fn an_export_and_the_manual_print_their_files() {
    let bench = Bench::new("json-export");
    bench.report(&["run", "--set", "run.duration_s=0.05", "--no-plot", "--json"]);
    assert_eq!(
        bench.report(&["export", "out/run.mcap", "--csv", "--json"]),
        json!({ "record": "out/run.mcap", "rows": 50, "files": ["out/run.csv"], "damage": null })
    );
    assert_eq!(
        bench.report(&["man", "manual", "--json"]),
        json!({ "folder": "manual", "first": "manual/painleve.1" })
    );
    for file in ["out/run.csv", "manual/painleve.1"] {
        assert!(bench.path(file).exists(), "{file}");
    }
}
