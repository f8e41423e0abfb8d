// A line of text in the room that faces the viewer; it is drawn again only when the text changes.

import { CanvasTexture, LinearFilter, Sprite, SpriteMaterial, SRGBColorSpace } from "three";
import { css } from "./colours.js";

const WIDTH = 512, HEIGHT = 96; // pixels

export class Label {
  /** `size`: height in m as it is at 1 m; it looks as large from further away. */
  constructor(colour, size = 0.036) {
    this.canvas = document.createElement("canvas");
    [this.canvas.width, this.canvas.height] = [WIDTH, HEIGHT];
    this.texture = new CanvasTexture(this.canvas);
    this.texture.colorSpace = SRGBColorSpace;
    this.texture.minFilter = LinearFilter;
    this.sprite = new Sprite(new SpriteMaterial({ map: this.texture, transparent: true, depthTest: false, sizeAttenuation: false }));
    this.sprite.scale.set((size * WIDTH) / HEIGHT, size, 1);
    this.sprite.center.set(0, 0); // the text stands right of its place, and above it
    this.sprite.renderOrder = 10;
    this.colour = colour;
    this.text = null;
  }

  set(text, colour = this.colour) {
    const key = `${text} ${colour}`;
    this.sprite.visible = text !== "";
    if (key === this.text || text === "") return;
    this.text = key;
    const pen = this.canvas.getContext("2d");
    pen.clearRect(0, 0, WIDTH, HEIGHT);
    pen.font = "600 50px system-ui, sans-serif";
    pen.textBaseline = "middle";
    const width = Math.min(pen.measureText(text).width + 48, WIDTH);
    pen.fillStyle = "rgba(20, 24, 29, 0.85)";
    pen.beginPath();
    pen.roundRect(0, 8, width, HEIGHT - 16, 20);
    pen.fill();
    pen.fillStyle = css(colour);
    pen.fillText(text, 24, HEIGHT / 2, WIDTH - 48);
    this.texture.needsUpdate = true;
  }
}
