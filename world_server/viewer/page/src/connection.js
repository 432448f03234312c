// SPDX-License-Identifier: MIT
// The live stream: stays connected, whatever restarts, and says after each update that it was taken
// in. The server sends no more than a few updates ahead of that word.
import { decodeUpdate } from "./decode.js";

const RETRY_MS = 500;

/**
 * @param {{onScene: function(Object), onUpdate: function(Object), onState: function(boolean)}}
 *     listener `onState`: connected or not
 */
export function connect(listener) {
  const socket = new WebSocket(`ws://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => listener.onState(true);
  socket.onclose = () => {
    listener.onState(false);
    setTimeout(() => connect(listener), RETRY_MS);
  };
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") {
      listener.onScene(JSON.parse(data));
    } else {
      listener.onUpdate(decodeUpdate(data));
      if (socket.readyState === WebSocket.OPEN) socket.send("+");
    }
  };
}
