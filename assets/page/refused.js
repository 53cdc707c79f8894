// Says why the page does not begin where browsers refuse its modules. So this is none, and no newer than they are.

(function () {
  function say(why) {
    var words = document.getElementById("panel-cover-text") || document.getElementById("waiting");
    words.textContent = why;
    var mirror = document.getElementById("mirror");
    if (mirror) mirror.setAttribute("data-phase", "failed");
    var bars = document.getElementsByTagName("progress");
    while (bars.length > 0) bars[0].parentNode.removeChild(bars[0]);
    var cover = document.getElementById("cover-text");
    if (cover) cover.textContent = "";
  }

  if (location.protocol === "file:") {
    say("Browsers refuse the scripts of pages that are opened as files. Have the folder served, as by: python3 -m http.server");
  } else if (!("noModule" in document.createElement("script"))) {
    say("This browser knows no JavaScript modules. The page needs Chrome 91, Firefox 114, Safari 16.4 or newer.");
  }
})();
