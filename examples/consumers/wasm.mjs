// MuJoCo's WASM: the file that every MuJoCo reads, with the springs that the manifest lists, goes to a target.
//
//     npm install @mujoco/mujoco onnxruntime-web
//     tar xzf org.trunkline.twin-0.1.0.tgz && node wasm.mjs

import { readFileSync } from "node:fs";
import loadMujoco from "@mujoco/mujoco";
import { InferenceSession, Tensor } from "onnxruntime-web";

const read = (path) => readFileSync(`package/${path}`);
const { springs, dampers, diagonals, rest_lengths: straight } = JSON.parse(read("Runtime/manifest.json")).model;
const { pose } = JSON.parse(read("Tests/Vectors/network.json")).cases.find((one) => !one.answer.doubtful).question;
const network = await InferenceSession.create(read("Runtime/Network/ik.onnx"));
const answer = await network.run({ pose: new Tensor("float32", pose, [1, pose.length]) });
const curved = (xml, { joint, tendon, coefficients }, attribute) =>
  xml.replace(RegExp(`(name="${joint ?? tendon}"[^>]* ${attribute}=")[^"]*`), `$1${coefficients.join(" ")}`);
let xml = [...springs, ...diagonals].reduce((xml, law) => curved(xml, law, "stiffness"), `${read("Runtime/Model/arm.xml")}`);
xml = dampers.reduce((xml, law) => curved(xml, law, "damping"), xml);
const mujoco = await loadMujoco();
const model = mujoco.MjModel.from_xml_string(xml);
model.body("base").quat.set([1, 0, 0, 0]); // the world is the base frame
model.opt.gravity.set(pose.slice(0, 3).map((x) => 9.80665 * x));
const data = new mujoco.MjData(model);
data.ctrl.set(Object.values(straight).map((length, i) => length - answer.commands.data[i])); // pulls, m
while (data.time < 20) mujoco.mj_step(model, data); // until it rests
const tip = [...data.site("tip").xpos];
const missed = 1e3 * Math.hypot(...tip.map((x, i) => x - pose[3 + i]));
console.log(`tip at ${tip.map((x) => x.toFixed(6)).join(", ")} m, ${missed.toFixed(2)} mm from its target`);
