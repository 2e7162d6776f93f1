// What needs somebody now: told above everything else, by those nodes that noticed it.

const PREFIX = 'alarm: ';

/** The alarms of the nodes: name, text, node. */
export function alarmsOf(nodes) {
  return nodes.flatMap(({ name, state, values, age }) => {
    if (state === 'silent') {
      const text = `not heard for ${Math.round(age)} s; did it end, or is the machine too slow?`;
      return [{ name: 'node silent', text, node: name }];
    }
    return values
      .filter(([key]) => key.startsWith(PREFIX))
      .map(([key, text]) => ({ name: key.slice(PREFIX.length), text, node: name }));
  });
}

export class Alarms {
  constructor(list) {
    this.list = list;
    this.told = '';
  }

  /** Show them; those who listen hear of new ones, not of a second more of silence. */
  draw(alarms) {
    const told = JSON.stringify(alarms);
    if (told === this.told) return;
    this.told = told;
    this.list.hidden = alarms.length === 0;
    const shown = [...this.list.children];
    alarms.forEach(({ name, text, node }, index) => {
      const item = shown[index] ?? this.make();
      const parts = [name, text, node];
      [...item.children].forEach((part, k) => {
        if (part.textContent !== parts[k]) part.textContent = parts[k];
      });
    });
    shown.slice(alarms.length).forEach((item) => item.remove());
  }

  make() {
    const item = document.createElement('li');
    item.append(...['b', 'span', 'small'].map((tag) => document.createElement(tag)));
    this.list.append(item);
    return item;
  }
}
