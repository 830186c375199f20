//! A node of the caterpillar on dora: `dora-caterpillar source|relay|sink COUNT [RESULT]`. The last sink
//! writes the latency of each payload from the source, ns, to RESULT as a JSON list.

use std::error::Error;
use std::time::{SystemTime, UNIX_EPOCH};

use dora_node_api::{DoraNode, Event, into_vec};

/// Number of warm-up messages.
const WARM_UP: usize = 100;

fn now() -> Result<u64, Box<dyn Error>> {
    Ok(SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos() as u64)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let role = arguments.next().ok_or("expected source, relay or sink")?;
    let count: usize = arguments.next().ok_or("expected a count")?.parse()?;
    let result = arguments.next();
    let (mut node, mut events) = DoraNode::init_from_env()?;
    let mut samples: Vec<u64> = Vec::with_capacity(count + WARM_UP);
    let mut sent = 0;
    while let Some(event) = events.recv() {
        let Event::Input { metadata, data, .. } = event else { continue };
        let parameters = metadata.parameters;
        match role.as_str() {
            // 512 bytes, like motorium's relays: written and read completely
            "source" => {
                node.send_output("out".into(), parameters, vec![now()?; 64])?;
                sent += 1;
                if sent == count + WARM_UP {
                    break;
                }
            }
            "relay" => {
                let values: Vec<u64> = into_vec(&data)?;
                let first = values.first().copied().ok_or("an empty payload")?;
                node.send_output("out".into(), parameters, vec![first; 64])?;
            }
            _ => {
                let values: Vec<u64> = into_vec(&data)?;
                let first = values.first().copied().ok_or("an empty payload")?;
                let same = values.iter().all(|value| *value == first);
                samples.push(if same { now()?.saturating_sub(first) } else { u64::MAX });
            }
        }
    }
    if let Some(path) = result {
        let texts: Vec<String> = samples.iter().skip(WARM_UP).map(u64::to_string).collect();
        std::fs::write(path, format!("[{}]", texts.join(",")))?;
    }
    Ok(())
}
